"""Exported observers as units of FMI, loaded by FMPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from exported_c import Driven
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave

from hgorun.export.fmu import Compiler, compilers
from hgorun.export.fmu_templates import Version

GCC = [compiler for compiler in compilers() if len(compiler.command) == 1] or [Compiler(("gcc",), "linux", "x86_64")]


class Unit:
    """A unit that FMPy has loaded."""

    def __init__(self, file: Path, version: Version) -> None:
        description = fmpy.read_model_description(str(file))
        self.number = {v.name: v.valueReference for v in description.modelVariables}
        two = version == "2.0"
        self.unit: Any = (FMU2Slave if two else FMU3Slave)(
            guid=getattr(description, "instantiationToken", None)
            or description.guid,  # older ones have one name for both
            unzipDirectory=fmpy.extract(str(file), str(file.with_suffix(".d"))),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.get = self.unit.getReal if two else self.unit.getFloat64
        self.set = self.unit.setReal if two else self.unit.setFloat64
        # a logger of its own: FMPy's lets C call the one that was given last, which may be gone
        self.said: list[tuple[int, str, str]] = []  # status, category and text of messages

        def log(*words: Any) -> None:
            status, category, text = words[-3:]
            self.said.append((status, category.decode(), text.decode()))

        self.callbacks = fmi2CallbackFunctions(fmi2CallbackLoggerTYPE(log))
        self.unit.instantiate(**({"callbacks": self.callbacks} if two else {"logMessage": log}))
        if two:
            self.unit.setupExperiment(startTime=5.0)
        self.unit.enterInitializationMode(**({} if two else {"startTime": 5.0}))
        self.unit.exitInitializationMode()

    def tell(self, **values: float) -> None:
        """Inputs by name, with _ for the point."""
        for name, one in values.items():
            number = self.number[name.replace("_", ".", 1)]
            if name.startswith("new"):
                self.unit.setBoolean([number], [bool(one)])
            else:
                self.set([number], [float(one)])

    def follow(self, found: Driven, outputs: list[str]) -> np.ndarray:
        """The estimates at all events."""
        xhat = [number for name, number in self.number.items() if name.startswith("xhat")]
        rows = [self.get(xhat)]
        for k, samples in enumerate(found.samples[:-1]):
            now = found.events[k]
            self.tell(**{f"new_{name}": 0.0 for name in outputs})
            for i, taken, y, _ in samples:
                self.tell(**{f"y_{outputs[i]}": y, f"new_{outputs[i]}": 1.0})
                if f"age.{outputs[i]}" in self.number:
                    self.tell(**{f"age_{outputs[i]}": now - taken})
            self.unit.doStep(5.0 + now, found.events[k + 1] - now)
            rows.append(self.get(xhat))
        return np.array(rows)
