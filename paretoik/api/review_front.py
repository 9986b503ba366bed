"""What a run's folder shows of its front: the end of the recording, and pictures."""

from __future__ import annotations

from paretoik.api.run_session import RunSession
from paretoik.front.front import Front
from paretoik.front.preferences import Weights
from paretoik.run_files import CERTIFICATES, PICTURE


def review_front(front: Front, session: RunSession) -> None:
    """Finish the recording with the motion of equal weights, and draw the front; neither after a signal."""
    if session.folder is None or session.recorder is None or session.signal is not None or not len(front):
        return
    session.recorder.finish(front, front.select(Weights(dict.fromkeys(front.names, 1.0))))
    draw_front(front, session)


def draw_front(front: Front, session: RunSession) -> None:
    """Draw the front, and its certificates if it has any, into the run's folder, if there is one."""
    if session.folder is None:
        return
    from paretoik.review.plots import front_picture  # here: matplotlib takes its time

    front_picture(front, session.folder / PICTURE)
    if front.certificates is not None:
        from paretoik.review.certificate_plots import certificates_picture

        certificates_picture(front, session.folder / CERTIFICATES)
