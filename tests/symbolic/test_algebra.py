"""SymPy is loaded only by what traces a formula."""

import subprocess
import sys

LOADED = """\
import sys
import accelstudy.campaign.batch.overview, accelstudy.campaign.batch.config, accelstudy.study.config
print([name for name in ("sympy.core", "matplotlib", "scipy.stats") if name in sys.modules])
from accelstudy.symbolic.tracing import symbolic, symbols
import sympy
(x,) = symbols("x")
print(symbolic.maximum(x, 2 * x).diff(x).subs(x, 3), sympy.Symbol is type(x))
"""


def test_a_configuration_is_checked_without_sympy():
    ran = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines() == ["[]", "2 True"]
