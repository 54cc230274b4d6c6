"""Where a motion was stopped, and by which event: what `events.until` answers."""

from typing import Annotated

import equinox as eqx
import numpy as np
from jaxtyping import Array

from jaxdyn import _text
from jaxdyn._text import counted
from jaxdyn.status import Status


class Stop(eqx.Module):
    """Where a motion was stopped.

    Attributes:
      t: () time of the event, or the end of the span if there was none; NaN if the run failed.
      y: (k,) state then, on the event or a rounding before it, not beyond; where the motion
        started on the event and meets it within 1e-30 of a step, possibly beyond it by as much.
        NaN if the run failed.
      event: () index of the event, -1 for none.
      status: () `Status` code.
      coincident: (E,) whether each of the events happens at this time, to rounding; several do
        where a ball runs into a corner. `event` is one of them. All False if there was none.
    """

    t: Array
    y: Array
    event: Array
    status: Annotated[Array, Status]
    coincident: Array

    __repr__ = _text.fields
    _repr_html_ = _text.html

    @property
    def happened(self) -> bool:
        """Whether it was an event that ended the motion; host only."""
        return bool(self.event >= 0)

    @property
    def message(self) -> str:
        """What ended the motion, and when; host only.

        Of a batch, how many motions each of the events ended, and the first failure.
        """
        if self.status.ndim:
            return self._message_of_batch
        if self.status != Status.OK:
            return Status(int(self.status)).message
        if not self.happened:
            return f"No event happened up to the end of the span, t = {float(self.t):.6g}."
        others = [str(i) for i in np.flatnonzero(self.coincident) if i != self.event]
        also = f", with {', '.join(others)} at the same time" if others else ""
        return f"Event {int(self.event)} happened at t = {float(self.t):.6g}{also}."

    @property
    def _message_of_batch(self) -> str:
        right = np.asarray(self.status) == Status.OK
        reached, counts = np.unique(np.asarray(self.event)[right], return_counts=True)
        parts = [
            f"{counted(n, 'motion')}: " + (f"event {i}." if i >= 0 else "no event.")
            for i, n in zip(reached.tolist(), counts.tolist(), strict=True)
        ]
        bad = np.asarray(self.status)[~right]
        failed = (
            [f"{counted(len(bad), 'motion')}: {Status(int(bad[0])).message}"] if bad.size else []
        )
        return " ".join([*parts, *failed])
