"""What the reduced-order observers for sampled plants of strict-feedback-like form share."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from hgorun.observers.base import SampledObserver
from hgorun.symbolic.strict_feedback import StrictFeedbackCopy, StrictFeedbackForm, strict_feedback_form


class ReducedOrder(SampledObserver[StrictFeedbackForm, StrictFeedbackCopy]):
    """The measured states are the latest sample; the others follow the Euler model of the plant."""

    form = staticmethod(strict_feedback_form)

    @abstractmethod
    def rates(self, form: StrictFeedbackForm) -> np.ndarray | None:
        """h_i, shape (n_z,): the error of the Euler model follows (I - T H)^k; None: it is gone in one step."""
