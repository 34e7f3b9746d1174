"""What the analysis says of sampling, delay and excitation: the exact limits of the linear error, the Gramians."""

from __future__ import annotations

from dataclasses import asdict

from hgorun.analysis.excitation.excitation import excitation
from hgorun.analysis.findings import Context, Findings
from hgorun.analysis.linear.nominal import nominal
from hgorun.analysis.stability.critical import critical, critical_chain

_KEYS = ("period_critical", "delay_critical", "period_critical_chain", "delay_critical_chain")


def limits(context: Context) -> dict[str, Findings]:
    """period_critical and delay_critical of every observer, with the plant of the run and, _chain, on phi = 0."""
    run, found = context.run, {}
    result = nominal(run)
    for label in context.result.observers:
        findings = Findings()
        values = (*critical(run, label, result), *critical_chain(run, label))
        for key, limit in zip(_KEYS, values, strict=True):
            if limit.value is None:
                findings.withhold(limit.reason, key)
            else:
                findings.give(**{key: limit.value})
                if limit.where:
                    findings.remarks.append(f"{key}: {limit.where}")
        found[label] = findings
    return found


def excitations(context: Context) -> dict[str, Findings]:
    """The largest delta of the excitation condition, where and of which state it is least, and P or S on line."""
    found = {}
    for label in context.result.observers:
        findings, seen = Findings(), excitation(context.run, label, context.result)
        if isinstance(seen, str):
            findings.withhold(seen, "excitation")
        else:
            details = asdict(seen)
            findings.give(excitation=details.pop("delta"), excitation_at=details.pop("at"), excitation_details=details)
            findings.remarks.append(f"excitation: {seen.words}")
        found[label] = findings
    return found
