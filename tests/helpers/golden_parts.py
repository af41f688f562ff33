"""The parts of the golden set: what is run, in which folder, and what of it is kept."""

import json
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from example_helpers import EXAMPLES, FIGURES, SHOWN
from places import DATA, ROOT
from refusals import texts as refusals
from transcript import Shell, commands_of_page, commands_of_script, rows_text, table_text

Texts = Iterator[tuple[str, str]]
"""Names of texts, and what is kept of each."""
GOLDEN = ROOT / "tests/golden"

# --- commands of pages ---------------------------------------------------------------------------

PAGES = {
    "readme": ["README.md", "docs/index.md", "docs/start/index.md"],
    "first": ["README.md", "docs/guides/your-sensor.md", "docs/guides/missing.md",
              "docs/reference/api/first_steps.py"],
    "measuring": ["docs/start/geodesist.md", "docs/guides/device.md",
                  "docs/guides/python_example.py"],
    "sensors": ["docs/guides/compare.md", "docs/guides/history.md"],
    "designing": ["docs/start/robotics.md", "docs/guides/configuration.md",
                  "docs/guides/designs.md", "docs/guides/simulated-campaigns.md",
                  "docs/guides/sequential.md"],
    "reference": ["docs/guides/reference.md"],
}  # fmt: skip
"""Pages whose commands can be typed one after the other; in `first`, those of --help come last."""
PLANS = ["README.md", "docs/start/index.md", "docs/guides/plan.md"]
SKIPPED = {
    "make": "needs the repository, and minutes",
    "snakemake": "needs the repository, and minutes",
    "accelstudy public [a-z].*": "downloads; the part `logs` does the same",
    r"accelstudy batch 'campaigns/\*'": "takes the campaigns of the log that are downloaded",
    "accelstudy plan": "stands in the part `plans`",
    "accelstudy claims": "stands in the parts `paper` and `smoke`",
    r".*(zsh|fish)_source": "is for another shell",
}
"""Beginnings of commands that are not run -> why."""


def log_table(seed, noise=0.005):
    """A log at 100 samples a second: 24 holds of 4 s, and a turn of 1 s before each."""
    z = 1 - (np.arange(24) + 0.5) / 12
    azimuth = 2.399963 * np.arange(24)
    level = np.sqrt(1 - z**2)
    forces = -9.81 * np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), z])
    turns = zip(np.roll(forces, 1, axis=0), forces, strict=True)
    rows = [np.vstack([np.linspace(a, b, 100), np.tile(b, (400, 1))]) for a, b in turns]
    readings = np.concatenate(rows) * [1.002, 0.999, 1.001] + [0.05, 0.01, 0.03]
    readings += noise * np.random.default_rng(seed).standard_normal(readings.shape)
    return pd.DataFrame(np.round(readings, 5), columns=["ax", "ay", "az"])


def arm_table():
    """Means of an arm with angles in degrees and axes of ROS, as robotics.md describes them."""
    rng = np.random.default_rng(6)
    roll, pitch = rng.uniform(-170, 170, 20), rng.uniform(-70, 70, 20)
    phi, theta = np.radians(roll), np.radians(pitch)
    down = [-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    forces = -9.80665 * np.column_stack(down) * [1, -1, -1] * 1.001
    table = pd.DataFrame(forces + rng.normal(0, 0.002, forces.shape), columns=["fx", "fy", "fz"])
    angles = {"time": 20.0 * np.arange(20), "roll": roll, "pitch": -pitch}
    angles["yaw"] = rng.uniform(-170, 170, 20)
    return table.assign(**angles).round(6)


def write_inputs(shell, texts):
    """Write what a reader of texts has: logs, campaigns, calibrations, and the configuration."""
    names = {"log": False, "calibration": True, "ref": True, "first": True, "imu": True}
    for name, named in (names | {"log": "--reference ref/" in texts}).items():
        seed = 1 if name == "calibration" else [*names].index(name) + 1
        table = log_table(seed)
        if named:
            table.insert(0, "t", np.arange(len(table)) / 100)
        table.to_csv(shell.folder / f"{name}.csv", index=False, header=named)
    arm_table().to_csv(shell.folder / "poses.csv", index=False)
    shutil.copytree(ROOT / "config", shell.folder / "config")
    simulate = "accelstudy simulate-campaign --seed"
    for seed, season in enumerate(("spring", "autumn", "winter"), 1):
        if f"{season}/" in texts or f"of-{season}" in texts:
            bias = f'--effect "bias: 0.1, {0.05 + 0.01 * seed:.2f}, -0.1"'
            shell.run(f"{simulate} {seed} --out of-{season} {bias}")
            shell.run(f"accelstudy calibrate of-{season} --out {season}")
        if f"sensor-{seed}" in texts:
            shell.run(f"{simulate} {seed} --out sensor-{seed} --scheme fibonacci-18")


def walk(folder, commands, skipped=SKIPPED, **options) -> Texts:
    """Transcripts of lists of commands, {name: commands}, one after the other in one folder."""
    shell = Shell(folder, skipped, **options)
    lines = [line for each in commands.values() for line in each]
    write_inputs(shell, "\n".join(line for line in lines if not shell.reason_to_skip(line)))
    for name, lines in commands.items():
        yield name, shell.transcript(lines)


def page_commands(paths):
    """Commands of pages, {name: commands}; a page of Python is one."""
    texts = {path: (ROOT / path).read_text("utf-8") for path in paths}
    return {
        path.partition(".")[0].replace("/", "-"): (
            [text] if path.endswith(".py") else commands_of_page(text)
        )
        for path, text in texts.items()
    }


def pages(folder, part) -> Texts:
    commands = page_commands(PAGES[part])
    if part == "first":
        examples = (text.partition("Example:\n")[2] for _, text in helps(folder))
        commands["help-examples"] = commands_of_script("".join(examples))
    for name, text in walk(folder, commands):
        if (part, name) != ("first", "README"):  # the others take files from it
            yield name, text


def script(folder, name, **options) -> Texts:
    """The commands of a script beside what is kept, which no page shows."""
    text = (GOLDEN / f"{name}.sh").read_text("utf-8")
    yield from walk(folder, {name: commands_of_script(text)}, **options)


def helps(folder) -> Texts:
    """Each command with its help, in the order of `accelstudy --help`."""
    shell = Shell(folder)
    _, top, _ = shell.run("accelstudy --help")
    yield "accelstudy", top
    for line in top.partition("Options:")[2].splitlines():
        if line.startswith("  ") and line[2].islower():
            name = line.split()[0]
            yield name, shell.run(f"accelstudy {name} --help")[1]


def tutorials(folder, names) -> Texts:
    """The commands of tutorials, each in a folder of its example, and whether figures are new."""
    from pictures import same_picture

    for name in names:
        shutil.copytree(EXAMPLES / name, folder / name)
        commands = commands_of_script((EXAMPLES / name / "commands.sh").read_text("utf-8"))
        said = Shell(folder / name).transcript(commands)
        for figure in FIGURES.get(name, ()):
            same = same_picture(folder / name / figure, SHOWN / name / Path(figure).name)
            said += f"{figure}: {'as' if same else 'not as'} its tutorial shows it\n"
        yield name, said


def plans(folder) -> Texts:
    """All plans that pages show, the same question once."""
    shell = Shell(folder)
    for name, lines in page_commands(PLANS).items():
        yield name, shell.transcript([x for x in lines if x.startswith("accelstudy plan")])


# --- sessions, lots, logs ------------------------------------------------------------------------

ADVISED = {
    "guide": ("--scheme faces-edges-corners-26 --approach gravity --seed 3",
              "--tilt-accuracy 15mgon --tilt-range 30gon", None),
    "robot": ("--scheme fibonacci-16 --order random --approach robot --seed 4 --no-sigma-known",
              "--tilt-accuracy 10mgon --tilt-range 30gon", 7),
}  # fmt: skip
"""The session of the guide; and one with a robot and unknown noise, whose 7th position is wrong."""


def advise(folder) -> Texts:
    """What `advise` says before the first position and after each."""
    for name, (simulate, options, wrong) in ADVISED.items():
        shell = Shell(folder)
        shell.run(f"accelstudy simulate-campaign --out {name} {simulate}")
        table = pd.read_csv(folder / name / "positions.csv", dtype=str)
        if wrong:
            column = table.columns.get_loc("fx")
            for i in range(column, column + 3):
                table.iloc[wrong - 1, i] = f"{1.004 * float(table.iloc[wrong - 1, i]):.9f}"
        said = []
        for n in range(len(table) + 1):
            table[:n].to_csv(folder / name / "positions.csv", index=False)
            said.append(f"positions: {n}\n{shell.told(f'accelstudy advise {name} {options}')}")
        yield name, "".join(said)


COMMON = "--scheme fibonacci-24 --order random --temperature 15:40 --temperature-order random"
LOTS = {
    "nothing": [COMMON] * 12,
    "warm": [f"{COMMON} --effect thermal_bias --size 0.1"] * 12,
    "mixed": [*[f"{COMMON} --effect quadratic_scale --size 0.3"] * 6, *[COMMON] * 6,
              f"{COMMON} --effect hysteresis --size 3"],
}  # fmt: skip
"""Nothing is missing; a small thermal bias in all; an effect in half of them, and one is odd."""


def lots(folder) -> Texts:
    for name, sensors in LOTS.items():
        (folder / name).mkdir()
        shell = Shell(folder / name)
        for i, options in enumerate(sensors, 1):
            shell.run(f"accelstudy simulate-campaign --seed {i} --out s{i:02d} {options}")
        yield name, shell.told("accelstudy lot 's??' --approach robot --out lot")


LOGS = {
    "xsens-mti": 100, "mpu9150-0": 100, "mpu9150-1": 100, "mpu9150-2": 100, "mpu6050": 100,
    "mpu6050-static": 100, "lis3dh-phone": 50, "ck-explorer": None, "ferraris": 204.8,
    "ferraris-annotated": 204.8,
}  # fmt: skip
"""Public logs, and their samples a second; that of ck-explorer has a time."""


def logs(folder) -> Texts:
    """Public logs, with the first and the last sample of each hold that was found.

    And what the page about them says of the one whose diagnosis takes longest.
    """
    from real_data import of_the_longest

    yield from of_the_longest()
    shell = Shell(folder)
    (folder / "resources").mkdir()
    (folder / "resources/public").symlink_to(DATA)
    for name, rate in LOGS.items():
        told = shell.told(f"accelstudy public {name} --out {name}")
        if rate and (positions := folder / name / "positions.csv").exists():
            table = pd.read_csv(positions)
            first = table["time_s"] * rate - (table["n_samples"] - 1) / 2
            ends = {"first_sample": first, "last_sample": first + table["n_samples"] - 1}
            told += rows_text(table[["position"]].assign(**ends))
        yield name, told


def real_data(folder) -> Texts:
    """What the page about public measurements quotes of the others."""
    from real_data import texts

    yield from texts()


# --- studies -------------------------------------------------------------------------------------

TABLES = ("cells", "summary", "correlations", "leveling", "quantiles", "claims",
          "sensitivity", "shapley")  # fmt: skip


def study(folder, name, configuration) -> Texts:
    """Tables of a study that Snakemake runs on one core, as two parts run at once."""
    shell = Shell(folder)
    shutil.copytree(ROOT / "config", folder / "config")
    tables = [f"results/{name}/{table}.parquet" for table in TABLES]
    status, *said = shell.run(
        f"snakemake --cores 1 --snakefile {ROOT}/Snakefile --directory . "
        f"--configfile {configuration} -- {' '.join(tables)}"
    )
    if status:
        raise RuntimeError("".join(said))
    for table, path in zip(TABLES, tables, strict=True):
        content = pd.read_parquet(folder / path)
        if "cell" in content:
            content = content.sort_values(["cell"], kind="stable")
        yield table, table_text(content)
    yield "claims-command", shell.told(f"accelstudy claims results/{name}")


# --- hidden campaigns ----------------------------------------------------------------------------

ANSWER = ("verdict", "specs", "positions", "posteriors", "place", "confirmed", "held_out_z",
          "sigma0_before", "sigma0_after", "p_size", "credible_set", "error")  # fmt: skip


def hidden(folder, approach) -> Texts:
    """What the diagnosis says of hidden campaigns, a line each."""
    from studies.hidden.campaigns import parse_hidden, row_of

    config = parse_hidden(yaml.safe_load((GOLDEN / "hidden.yaml").read_text("utf-8")))
    config = config.model_copy(update={"baselines_every": 0})
    rows = (row_of(config, *one) for one in config.campaigns() if one[0].approach == approach)
    yield "campaigns", "".join(map(answer, rows))


def answer(row):
    """The row of a diagnosis in a line, without what it does not say."""
    shown = {name: row.get(name) for name in ANSWER}
    texts = {k: json.dumps(v) if isinstance(v, list) else f"{v:.9g}" if isinstance(v, float)
             else str(v) for k, v in shown.items()}  # fmt: skip
    said = [f"{k} {v}" for k, v in texts.items() if v not in ("", "[]", "[null]", "nan", "None")]
    return f"{row['cell']} #{row['campaign']}: {'; '.join(said)}\n"


# --- all -----------------------------------------------------------------------------------------

PARTS: dict[str, Callable[[Path], Texts]] = {
    "paper": partial(study, name="paper", configuration="config/config.yaml"),
    "hidden-robot": partial(hidden, approach="robot"),
    "hidden-gravity": partial(hidden, approach="gravity"),
    "smoke": partial(study, name="smoke", configuration="config/smoke.yaml"),
    "tutorials": partial(tutorials, names=("effect", "hidden", "log", "paper", "pole", "scheme")),
    "tutorial-lot": partial(tutorials, names=("lot",)),
    "tutorial-sweep": partial(tutorials, names=("sweep",)),
    "plans": plans,
    **{part: partial(pages, part=part) for part in PAGES},
    "quiet": partial(script, name="quiet", files=False),
    "degrees": partial(script, name="degrees", ACCELSTUDY_ANGLE_UNIT="deg"),
    "refusals": refusals,
    "advise": advise,
    "lots": lots,
    "logs": logs,
    "real-data": real_data,
    "help": helps,
}
"""Those that take longest first."""
OF_DATA = ("logs", "real-data")
"""Parts that need the public measurements."""
QUICK = ("readme", "refusals", "help", "real-data")
"""Parts that `make test` compares, too."""
