"""The whole Pareto front of joint motions for a redundant arm.

The public names are in ``__init__.pyi``. Each is loaded when it is first used, so that ``import paretoik`` is quick.
"""

from typing import Any

import lazy_loader

from .handed_down import HANDED_DOWN as _HANDED_DOWN


def _keep_path(*arguments: Any, **named: Any) -> Any:
    """Compute a tool path, save it in a run folder and return it."""
    from .api.path_run import keep_path

    return keep_path(*arguments, **named)


def _open_view(*arguments: Any, **named: Any) -> Any:
    """Return the notebook view of a front."""
    from .review.drawing.front_view import open_view

    return open_view(*arguments, **named)


def _show_choice(*arguments: Any, **named: Any) -> Any:
    """Set a run's recording to open on the front's present choice."""
    from .review.drawing.choice_layer import show_choice_in_recording

    return show_choice_in_recording(*arguments, **named)


def _link_bodies(*arguments: Any, **named: Any) -> Any:
    """Return the convex bodies of a URDF's links, and the faults of their shapes."""
    from .collision.bodies import link_bodies

    return link_bodies(*arguments, **named)


def _body_table(*arguments: Any, **named: Any) -> Any:
    """Return a table of a robot's convex bodies."""
    from .collision.bodies import body_table

    return body_table(*arguments, **named)


_HANDED_DOWN.update(keep_path=_keep_path, open_view=_open_view, show_choice=_show_choice)
_HANDED_DOWN.update(link_bodies=_link_bodies, body_table=_body_table)
__version__ = "0.1.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
