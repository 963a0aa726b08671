"""Delays that the user states: a signal that was recorded too late is taken from later."""

import numpy as np

from detent.logs.draft import Draft


def take_out_delays(draft: Draft) -> None:
    """Take stated delays out, by straight lines between samples; samples without values on both sides are removed."""
    if not draft.delays:
        return
    inside = np.ones(len(draft), dtype=np.bool_)
    for role, delay in draft.delays.items():
        if role in draft.values:
            moments = draft.t + delay
            draft.values[role] = np.interp(moments, draft.t, draft.values[role])
            inside &= (moments >= draft.t[0]) & (moments <= draft.t[-1])
    draft.keep(inside)
