"""The recording of a run with the choice that was made on its front.

What Rerun writes goes through a pipe into memory: on a full disk its file sink may hang. A new file replaces the
recording once it has been read back, or not at all.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread

import rerun as rr
import rerun.blueprint as rrb
from rerun.error_utils import RerunWarning

from paretoik.errors import InvalidInput, ParetoikError
from paretoik.execution.run_folder import check_no_run
from paretoik.file_replacement import only_writer, replace_file
from paretoik.formulations.protocol import is_loop
from paretoik.front.choices import chosen
from paretoik.front.front import Choice, Front
from paretoik.review.drawing.choice_layer import ChoiceLayer
from paretoik.review.drawing.recorded_views import ROOTS, RecordedRun, layouts_without_choice, read_recorded
from paretoik.run_files import RECORDING, read_plain_file
from paretoik.user_warnings import warn_user

BLOCK = 1 << 20  # bytes read from a pipe at once


class RecordedLayout(rrb.Blueprint):
    """The layout that a recording had before anything was chosen, to be written again as it was."""

    def __init__(self, chunks: rr.chunk.LazyChunkStream) -> None:
        super().__init__()
        self._chunks = chunks

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.send_chunks(self._chunks)


def show_choice_in_recording(front: Front, *, moved: Choice | None = None, source: Path | None = None) -> None:
    """Let the recording in a front's run folder open on the present choice, or as it was made where there is none.

    A point that was ``moved`` to is shown beside the present choice, or alone where there is none or another run's
    recording is the ``source``. Nothing is done for a closed loop, whose motion is its recording's anyhow. A recording
    that cannot be read or replaced stays as it is, with a warning: the choice, or point, is kept elsewhere.
    """
    if front.folder is None or is_loop(front):
        return
    recording = front.folder / RECORDING
    source = recording if source is None else source
    try:
        with only_writer(front.folder):  # so that of several choices the recording has the last
            check_no_run(front.folder)
            read_plain_file(source)  # no link, whose target would stay as it is
            point = front.choices.chosen
            if point is not None and point.point not in front:  # of a newer front, whoever chose it
                return
            recorded = _read_whole(source)
            shown = {each.id: each for each in (chosen(front), moved) if each is not None}
            choice, compare = (*shown.values(), None, None)[:2]
            content = recording_with_choice(front, choice, recording=source, compare=compare)
            replace_file(recording, content, check=lambda file: _check_holds(file, recorded))
    except Exception as fault:  # it is a view, and may fail in any way
        cause = str(fault) if isinstance(fault, ParetoikError) else f"{recording}: {type(fault).__name__}: {fault}"
        what = "choice" if moved is None else "point"
        text = f"the recording stays as it was, the {what} is kept: {' '.join(cause.split())}"
        warn_user(text)


def recording_with_choice(
    front: Front, choice: Choice | None, *, recording: Path, compare: Choice | None = None
) -> bytes:
    """Return the content of a recording that opens on a choice, beside it another one, in place of one it may have.

    Without a choice it opens as it was made. Raises InvalidInput where the recording cannot be read.
    """
    recorded = read_recorded(recording)
    reader = rr.chunk.RrdReader(recording)
    (store,) = reader.recordings()
    content = bytearray()
    with _stream_into(content, recorded) as stream:
        stream.send_chunks(reader.stream(store=store).drop(content=[f"/{root}/**" for root in ROOTS]))
        for layout in layouts_without_choice(reader)[:1]:
            opens = choice is None
            stream.send_blueprint(RecordedLayout(reader.stream(store=layout)), make_active=opens, make_default=opens)
        if choice is not None:
            choices = (choice,) if compare is None else (choice, compare)
            layer = ChoiceLayer(front=front, choices=choices, recorded=recorded)
            layer.log(stream)
            stream.send_blueprint(layer.blueprint(), make_active=True, make_default=True)
    return bytes(content)


@contextmanager
def _stream_into(content: bytearray, recorded: RecordedRun) -> Iterator[rr.RecordingStream]:
    """Yield a stream of the same recording, all of which stands in ``content`` at the end."""
    source, sink = os.pipe()

    def drain() -> None:
        while block := os.read(source, BLOCK):
            content.extend(block)

    reader = Thread(target=drain, daemon=True)
    reader.start()
    stream = rr.RecordingStream(recorded.application, recording_id=recorded.identity, send_properties=False)
    try:
        stream.save(f"/dev/fd/{sink}")
        yield stream
        stream.flush()
    finally:
        with suppress(RuntimeError):
            stream.disconnect()
        os.close(sink)
        reader.join()
        os.close(source)


def _read_whole(recording: Path) -> RecordedRun:
    """Return what a recording has; raises InvalidInput for one that was cut off, of which some can be read."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RerunWarning)
        try:
            return read_recorded(recording)
        except RerunWarning as fault:
            raise InvalidInput(f"{recording}: wanted a whole recording, got one that was cut off") from fault


def _check_holds(file: Path, former: RecordedRun) -> None:
    """Raise InvalidInput unless a recording has all that the former one has."""
    recorded = _read_whole(file)
    if recorded != former:
        missing = sorted(former.entities - recorded.entities)
        raise InvalidInput(f"{file}: wanted all of the former recording, got one without {missing[:1]}")
