"""What every observer and every plant must keep, as checks to call from tests of your own.

>>> from hgorun.testing import check_observer
>>> print(check_observer(MyObserver))            # doctest: +SKIP
"""

from __future__ import annotations

from hgorun.testing.contract import ContractError, Report
from hgorun.testing.observers import check_observer
from hgorun.testing.plants import check_plant

__all__ = ["ContractError", "Report", "check_observer", "check_plant"]
