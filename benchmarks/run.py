"""All benchmarks of speed, and the tables that show them.

    python benchmarks/run.py [PAGE]

PAGE is a Markdown file, such as docs/guides/speed.md: its tables are replaced. Without it the
tables are printed, and no more. It takes some minutes. All works take turns, and processor time is
taken, so that what else the machine does hits all alike.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when NumPy is imported

import platform  # noqa: E402
import sys  # noqa: E402
from datetime import date  # noqa: E402
from importlib.metadata import version  # noqa: E402
from pathlib import Path  # noqa: E402

import around  # noqa: E402
import precision  # noqa: E402
import speeds  # noqa: E402
from page import put  # noqa: E402
from ways import WAYS  # noqa: E402

PARTS = (speeds, around)
NAMES = ("machine", "precision", *(part.__name__ for part in PARTS))
"""Tables of the page."""


def machine():
    """Say when, where and with what it ran."""
    cpuinfo = Path("/proc/cpuinfo")
    names = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    name = next((line.split(": ")[1] for line in names if line.startswith("model name")), "")
    used = ("accelstudy", "numpy", "scipy", "llvmlite")
    packages = [f"{each} {version(each)}" for each in used]
    packages += [] if WAYS.get("numba").missing() else [f"numba {version('numba')}"]
    load = ", ".join(f"{each:.1f}" for each in os.getloadavg())
    return (
        f"{date.today()}, {name or platform.machine()}, {os.cpu_count()} cores, "
        f"Python {platform.python_version()}, {', '.join(packages)}; "
        f"load at the start (1, 5, 15 minutes) {load}."
    )


def main(arguments):
    """Run all parts; print each when it is done."""
    for way in map(WAYS.get, WAYS.names()):
        if way.missing():
            print(f"{way.title}: not measured; it needs {way.missing()}", flush=True)
    texts, results = {"machine": machine()}, {}
    path = Path(arguments[0]) if arguments else None
    page = path.read_text() if path else ""
    for name in NAMES if path else ():
        put(page, name, "")  # before the minutes that measuring takes
    for part in PARTS:
        results[part] = part.run()
        texts[part.__name__] = part.tables(results[part])
        print(f"\n{part.__doc__}\n\n{texts[part.__name__]}", flush=True)
    texts["precision"] = precision.tables(precision.run(results[speeds][0]))
    print(f"\n{precision.__doc__}\n\n{texts['precision']}", flush=True)
    if path:
        for name, text in texts.items():
            page = put(page, name, text)
        path.write_text(page)


if __name__ == "__main__":
    main(sys.argv[1:])
