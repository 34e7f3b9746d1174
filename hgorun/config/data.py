"""The block ``data`` of a configuration: which columns of which files are the measurements."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler, WithJsonSchema, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from hgorun.config.date_letters import with_percent
from hgorun.config.date_signs import require_signs
from hgorun.config.nearest import meant
from hgorun.config.types import Absolute, Block, Interval, Name, NonEmpty, Number, Positive, describe, word_or

MISSING = ("", "nan", "-nan", "na", "n/a", "#n/a", "<na>", "null", "nil", "none")
"""Texts that stand for a missing value in every file, in small letters."""

FORMATS = ("iso", "unix", "excel", "excel1904")
"""How time stamps may be written, beside plain numbers and patterns."""

_WEEKDAYS = ("%a", "%A", "%w", "%u")
_DATES = ("%d", "%j", "%x", "%c", "%Y", "%y")
_TEXT_OR_BLOCK = "the name of a column, or a mapping with column and more"


def _texts(value: Any) -> Any:
    """One text or several; a number as YAML reads it is one."""
    given = value if isinstance(value, (list, tuple)) else (value,)
    return tuple(str(one) if isinstance(one, (int, float)) and not isinstance(one, bool) else one for one in given)


_ONE = {"type": ["string", "number"]}


class Csv(Block):
    """How a text file is written; what is left out is found from the file."""

    separator: Annotated[str, Field(min_length=1, max_length=1)] | None = Field(
        default=None, description="between columns (default: the one of , ; tab | that the header has)"
    )
    decimal: Literal[".", ","] | None = Field(default=None, description="decimal point or comma (default: found)")
    thousands: Literal[".", ",", " ", "'"] | None = Field(
        default=None, description="between thousands (default: numbers have no such sign)"
    )
    encoding: Literal["utf-8", "utf-16", "latin-1", "cp1252"] | None = Field(
        default=None, description="default: by the mark at the beginning, else utf-8"
    )
    comment: Annotated[str, Field(min_length=1, max_length=1)] = Field(
        default="#", description="lines that begin with it are passed over"
    )
    skip: Annotated[int, Field(ge=0, le=1000, strict=True)] = Field(default=0, description="lines above the header")
    units_row: Annotated[bool, Field(strict=True)] | None = Field(
        default=None, description="whether a row of units follows the header (default: found)"
    )
    missing: Annotated[
        tuple[str, ...], BeforeValidator(_texts), WithJsonSchema({"anyOf": [_ONE, {"type": "array", "items": _ONE}]})
    ] = Field(
        default=(),
        description="texts and numbers that stand for a missing value, also in Parquet and HDF5, beside empty cells, "
        f"{', '.join(MISSING[1:-1])} and {MISSING[-1]}",
    )

    @model_validator(mode="after")
    def _two_signs(self) -> Csv:
        if self.thousands is not None and self.thousands == self.decimal:
            raise ValueError(f"thousands and decimals cannot both have the sign {self.thousands!r}")
        return self


class Faults(Block):
    """What is done about faults in the data. Whatever it is, it is reported with its lines."""

    repeated: Literal["refuse", "first", "last", "mean", "keep"] | None = Field(
        default=None, description="a time stamp that has come before (default: refuse)"
    )
    backwards: Literal["refuse", "sort", "drop"] | None = Field(
        default=None, description="time stamps that run backwards (default: refuse; late samples are sorted)"
    )
    gaps: Literal["report", "refuse"] | None = Field(
        default=None, description="time stamps that jump ahead: more than 20 median steps (default: report)"
    )
    filled: Literal["refuse", "report", "drop"] | None = Field(
        default=None,
        description="values filled in by interpolation, exactly on a line; drop keeps the ends of the lines "
        "(default: refuse)",
    )
    stuck: Literal["report", "refuse", "drop"] | None = Field(
        default=None, description="stretches of a constant value; drop keeps the first (default: report)"
    )
    slips: Literal["refuse", "report"] | None = Field(
        default=None, description="values that change by a factor such as 1000 from one sample on (default: refuse)"
    )
    implausible: Literal["drop", "refuse"] | None = Field(
        default=None, description="values outside of plausible (default: drop)"
    )
    missing: Literal["drop", "refuse"] | None = Field(
        default=None, description="values that are missing or NaN (default: drop)"
    )

    def over(self, other: Faults) -> Faults:
        """These, and where nothing is said those of another block."""
        return other.model_copy(update={key: value for key, value in self if value is not None})


class _OrText:
    """The JSON schema of a block that may also be a text."""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"type": "string"}, handler(schema)]}


def _column(value: Any) -> Any:
    """A column may be given by its name alone."""
    if isinstance(value, str):
        return {"column": value}
    if not isinstance(value, (dict, Block)):
        raise ValueError(f"expected {_TEXT_OR_BLOCK}, found {describe(value)}")
    return value


def _clock(value: Any) -> Any:
    """The same of time stamps, which stand in one column."""
    columns = value.get("column") if isinstance(value, dict) else value
    if isinstance(columns, (list, tuple)) and len(columns) > 1:
        raise ValueError(
            f"expected the name of one column, found a list of {len(columns)}; a date and a time of day in two columns "
            "are not joined: write a column into the file that has both, such as 2024-05-31 13:45:10, or take that of "
            f"the times where no gap lasts a day: {{column: {columns[-1]}, format: '%H:%M:%S', next_day: true}}"
        )
    return _column(value)


def has_date(form: str) -> bool:
    """Whether a format, or a pattern, says which day it is."""
    of_weeks = any(sign in form for sign in ("%U", "%W", "%V")) and any(sign in form for sign in _WEEKDAYS)
    return "%" not in form or of_weeks or any(sign in form for sign in _DATES)


class Clock(Block):
    """The column with the time stamps."""

    column: str = Field(description="its name in the file")
    unit: str | None = Field(
        default=None,
        description="of numbers: ns, us, ms, s, min, h, d, week (default: the unit of time.unit; unix: s; available: "
        "that of the time beside it)",
    )
    format: str | None = Field(
        default=None,
        description="iso, unix, excel, excel1904, or a pattern such as %d.%m.%Y %H:%M:%S (default: numbers, or iso "
        "where the column holds such text; available: that of the time beside it)",
    )

    next_day: Annotated[bool, Field(strict=True)] = Field(
        default=False,
        description="with a pattern that has no date: a time that lies more than 12 h before the one above is of the "
        "next day (default: all times are of one day)",
    )

    @model_validator(mode="after")
    def _known(self) -> Clock:
        if self.format is not None and "%" not in self.format and self.format not in FORMATS:
            pattern = with_percent(self.format)
            near = f". Did you mean `{pattern}`?" if pattern else meant(self.format, FORMATS)
            found = f"found {describe(self.format)}{near}"
            raise ValueError(f"format is {', '.join(FORMATS)} or a pattern with %Y, {found}")
        form = self.format or ""
        require_signs(form)
        if not has_date(form) and any(sign in form for sign in _WEEKDAYS):
            remedy = "write dates, or the time since the start, into the file"
            raise ValueError(f"format {form} has days of the week but no date, so that days would be lost: {remedy}")
        if ("%I" in form) != ("%p" in form):
            rule = "hours to 12 are %I with %p (AM, PM), those to 24 are %H without"
            raise ValueError(f"format {form} leaves open which half of the day it is: {rule}")
        if self.next_day and has_date(form or "iso"):
            raise ValueError("next_day is for patterns that have no date, such as %H:%M:%S: leave it out")
        if self.unit is not None and self.format is not None and self.format != "unix":
            raise ValueError(f"format {self.format} has no unit: leave out unit, dates are converted by themselves")
        return self


ClockKey = Annotated[Clock, BeforeValidator(_clock), _OrText()]


class Quality(Block):
    """A column that says which values are good."""

    column: str = Field(description="its name in the file")
    good: Annotated[tuple[Number | str, ...], NonEmpty] = Field(description="what it holds beside good values")


class Column(Block):
    """Where a quantity stands, and on which clock."""

    column: str = Field(description="its name in the file; in HDF5 its path")
    file: str | None = Field(default=None, description="default: data.file")
    time: ClockKey | None = Field(default=None, description="its time stamps (default: data.time)")
    unit: str | None = Field(default=None, description="of the column, where it is not that of the model: converted")
    csv: Csv | None = Field(default=None, description="default: data.csv")
    faults: Faults = Field(default_factory=Faults, description="what is done about faults (default: data.faults)")


class Judged(Column):
    """A measured quantity, not each value of which is used."""

    plausible: Interval | None = Field(
        default=None, description="[low, high] in the model's unit: values outside are not used"
    )
    quality: Quality | None = Field(default=None, description="{column, good: [...]}: other values are not used")


class Measured(Judged):
    """A measured quantity that observers get."""

    available: ClockKey | None = Field(
        default=None, description="the column that says when each value was known (default: when it was taken)"
    )
    gate: Positive | None = Field(
        default=None, description="standard deviations of the innovation beyond which a sample is not used"
    )
    std: Absolute | None = Field(default=None, description="standard deviation of its noise, in the model's unit")


class Beside(Judged):
    """A measured quantity that estimates are compared with."""

    @model_validator(mode="before")
    @classmethod
    def _never_used(cls, value: Any) -> Any:
        for key in ("available", "gate", "std"):
            if isinstance(value, dict) and key in value:
                raise ValueError(f"{key} is of samples that observers get, and none gets a reference: leave it out")
        return value

    lag: Positive | None = Field(
        default=None,
        description="time constant of the instrument, which follows the quantity with a first-order lag: estimates are "
        "sent through the same lag before they are compared",
    )


class Recorded(Column):
    """A recorded input."""

    hold: Literal["zero", "linear"] = Field(default="zero", description="what it is between its values")


MeasuredKey = Annotated[Measured, BeforeValidator(_column), _OrText()]
BesideKey = Annotated[Beside, BeforeValidator(_column), _OrText()]
RecordedKey = Annotated[Recorded, BeforeValidator(_column), _OrText()]


def _files(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


class Data(Block):
    """Measurements from files, in place of a simulated plant."""

    written_as = "data: {file: log.csv, time: COLUMN, outputs: {NAME: COLUMN}}"

    file: Annotated[
        tuple[str, ...],
        BeforeValidator(_files),
        WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
    ] = Field(
        default=(),
        description="CSV, Parquet, HDF5 or netCDF, relative to this file; several: parts of one log, in their order",
    )
    time: ClockKey | None = Field(default=None, description="the column with the time stamps")
    origin: str | Number | None = Field(
        default=None, description="the stamp that is time 0, for stamps that are dates (default: the first one)"
    )
    outputs: dict[Name, MeasuredKey] = Field(description="the plant's outputs")
    inputs: dict[Name, RecordedKey] = Field(default_factory=dict, description="inputs of the plant")
    reference: dict[Name, BesideKey] = Field(
        default_factory=dict, description="states or outputs that estimates are compared with, never used"
    )
    period: Positive | None = Field(
        default=None,
        description="the observers get a sample of an output only when so much time has passed since the last one that "
        "they got; those between are held out",
    )
    first_samples: Annotated[
        Annotated[int, Field(ge=1, le=1000, strict=True)] | Literal["auto"],
        word_or(("auto",), (int,), "a whole number from 1 to 1000"),
    ] = Field(
        default=1,
        description="of each output: observers without `initial` start where the model passes nearest to these; "
        "1: measured states start at the first sample, others at 0; auto: as many as agree on the start",
    )
    max_memory: Positive = Field(default=2.0**31, description="bytes allowed for the values read (default 2 GiB)")
    csv: Csv = Field(default_factory=Csv, description="how text files are written")
    faults: Faults = Field(default_factory=Faults, description="what is done about faults in the data")

    @model_validator(mode="after")
    def _something(self) -> Data:
        if not self.outputs:
            raise ValueError("expected at least one output")
        return self
