"""The keys that the block of every observer has."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hgorun.config.plugin import Plugin
from hgorun.config.types import Interval, Name, Number
from hgorun.observers.hold import Hold


class Keys(Plugin):
    """Where an observer starts, where it computes and corrects, and how samples come to it."""

    type: str = Field(description="name of the observer family")
    initial: dict[Name, Number] = Field(
        default_factory=dict, description="initial estimate in the plant's coordinates; omitted states are 0"
    )
    internal: dict[Name, object] = Field(
        default_factory=dict,
        description="initial values of internal states; a number fills the array, or is that multiple of the identity; "
        "of a covariance n numbers are the diagonal",
    )
    saturation: dict[Name, Interval] = Field(
        default_factory=dict, description="state: [low, high], applied to the arguments of F and phi"
    )
    clip_estimate: bool | None = Field(
        default=None,
        description="true: the shown estimate is clipped to saturation; the observer itself is not",
    )
    coordinates: Literal["original", "canonical"] = Field(
        default="original", description="where the observer computes; results are always in the plant's"
    )
    map: Literal["auto", "chain", "derivatives"] = Field(
        default="auto",
        description="coordinates in which a constant gain corrects: chain, the plant's states; derivatives, those of "
        "its outputs; auto, chain if the plant has this form",
    )
    chains: dict[str, Annotated[int, Field(ge=1, strict=True)]] = Field(
        default_factory=dict,
        description="output: length of its chain, for all outputs, n or more in total; chosen by default",
    )

    late: Literal["innovation", "replay", "drop"] | None = Field(
        default=None,
        description="what is done with late samples: innovation compares them with the estimate of the time when they "
        "were taken; replay goes back to that time and integrates again; drop leaves them out. By default innovation, "
        "and replay for observers that are corrected at samples",
    )
    hold: Hold | None = Field(
        default=None,
        description="what the innovation of a sampled output is until the next sample: predictor, the default, "
        "subtracts what the observer has corrected since; {shrink: gamma} lets it shrink as exp(-gamma (t - t_k))",
    )

    @property
    def canonical(self) -> bool:
        """Whether it computes in canonical coordinates."""
        return self.coordinates == "canonical"
