"""What a run's folder shows of its front: the end of the recording, and pictures."""

from __future__ import annotations

from paretoik.api.run_session import RunSession
from paretoik.front.compromise import compromise
from paretoik.front.front import Front
from paretoik.review.recording.recorder import SearchEnd
from paretoik.run_files import CERTIFICATES, PICTURE


def review_front(front: Front, session: RunSession) -> None:
    """Finish the recording with the compromise and its motion, and, unless a signal came, draw the front."""
    if session.folder is None or not len(front):
        return
    session.finish_recording(SearchEnd(front=front, choice=compromise(front)))
    if session.signal is not None:
        return
    from paretoik.review.pictures.plots import front_picture  # here: matplotlib takes its time

    front_picture(front, session.folder / PICTURE)
    if front.certificates is not None:
        from paretoik.review.pictures.certificate_plots import certificates_picture

        certificates_picture(front, session.folder / CERTIFICATES)
