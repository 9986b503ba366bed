from __future__ import annotations

import os

import hypothesis
from jaxtyping import install_import_hook

import tests.shape_checks  # the hook below knows it by name only

# In production annotations are not looked at; in tests every call and every field is checked against them.
install_import_hook("paretoik", "tests.shape_checks.checked")
assert tests.shape_checks.checked is not None

hypothesis.settings.register_profile("local", deadline=None)
hypothesis.settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "local")
