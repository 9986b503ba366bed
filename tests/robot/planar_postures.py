"""Postures and statics of planar arms with three joints in closed form: oracles that share nothing with the library."""

from __future__ import annotations

import numpy as np


def all_postures(lengths, place, headings):
    """Return postures (postures, 3) with the tool at a place: the last link in some directions, both elbows."""
    one, two, last = lengths
    wrist = place - last * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    cosine = ((wrist**2).sum(axis=1) - one**2 - two**2) / (2 * one * two)
    headings, wrist, cosine = (each[np.abs(cosine) <= 1] for each in (headings, wrist, cosine))
    found = []
    for elbow in (np.arccos(cosine), -np.arccos(cosine)):
        inner = np.arctan2(two * np.sin(elbow), one + two * np.cos(elbow))
        first = np.arctan2(wrist[:, 1], wrist[:, 0]) - inner
        found.append(np.stack([first, elbow, headings - first - elbow], axis=1))
    return (np.concatenate(found) + np.pi) % (2 * np.pi) - np.pi


def statics(q, lengths, masses, centers, gravity):
    """Return tool positions (postures, 2), Jacobians (postures, 2, 3) and gravity torques (postures, 3)."""
    turned = np.cumsum(q, axis=1)
    along = np.stack([np.cos(turned), np.sin(turned)], axis=2)
    tips = np.cumsum(lengths[:, None] * along, axis=1)
    joints = tips - lengths[:, None] * along
    across = tips[:, -1:] - joints
    columns = np.stack([-across[..., 1], across[..., 0]], axis=1)
    levers = (joints + centers[:, None] * along)[:, None] - joints[:, :, None]  # (posture, joint, body)
    pulls = masses * (levers[..., 1] * gravity[0] - levers[..., 0] * gravity[1])
    return tips[:, -1], columns, np.triu(pulls).sum(axis=2)
