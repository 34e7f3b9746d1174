"""What the innovation of a sampled output is until the next sample."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag

from hgorun.config.types import Block, NonNegative, word_or


class Shrinking(Block):
    """An innovation that shrinks from each sample to the next (Ahmed-Ali, Lamnabhi-Lagarrigue; Farza et al. 2014).

    With e(t_k) = C xhat(t_k) - y_k, e(t) = exp(-gamma (t - t_k)) e(t_k). gamma = 0 holds it. gamma = theta g_1 is the
    common innovation of ``shgo``, of which e' = -c = -theta g_1 e. So is, for any plant, an output predictor w' = L_f
    h(xhat), w(t_k) = y_k, e = h(xhat) - w (Karafyllis, Kravaris 2009), which is why ``hold: predictor`` is another name
    of it. The identities are derived, the forms of the publications quoted from memory.
    """

    shrink: NonNegative = Field(description="gamma >= 0, in 1/time")


def _hold(value: object) -> str:
    """Which of two forms the key has, so that errors speak of that one."""
    return "a mapping" if isinstance(value, (dict, Shrinking)) else "a word"


Hold: TypeAlias = Annotated[
    Annotated[Literal["predictor"], Tag("a word")] | Annotated[Shrinking, Tag("a mapping")],
    Discriminator(_hold),
    word_or(("predictor",), (dict, Shrinking), "{shrink: gamma}"),
]
