"""What takes the place of commands and keywords of earlier versions."""

COMMANDS = {
    "models": "`accelstudy catalogue models` lists them",
    "pole": "the tutorial 'The foot of a pole' (examples/pole) works it out with a calibration",
}
NO_DELIMITER = {"delimiter": "it is told from the rows"}
KEYWORDS = {
    "advise": {"watch": "`watch -n 2 accelstudy advise ...` of the shell asks again and again"},
    "apply": NO_DELIMITER,
    "data_sheet": NO_DELIMITER,
    "diagnose": {"replicates": "nothing is simulated; linear theory says what simulations find"},
    "find_holds": {
        **NO_DELIMITER,
        "join": "holds in one attitude are positions each",
        "sensor": "`columns` takes those of one sensor; import each into a folder of its own",
    },
    "find_positions": {
        "discriminate": "the report of a diagnosis has the positions that tell its rivals apart",
        "least_angle": "a repeated position tells as much as one apart; leave it out",
        "neglect": "put the effect into the model: positions that estimate it leave as little",
        "prior": "`after` takes a scheme that was measured; a prior is for `advise`",
        "mountings": "`attitudes` takes a scheme, as a file of the attitudes that a mount allows",
    },
    "init": {
        "sensor": "set `noise` and `sensor` in config/config.yaml of the new folder",
        "template": "it sets up a study; `accelstudy batch` and the others need no folder",
    },
    "plan": {
        "reference": "`accelstudy import --reference-log` takes a calibrated sensor",
        "robot_accuracy": "`robot_sigma` takes it",
        **dict.fromkeys(
            ("scheme", "schemes"), "`accelstudy.simulate(scheme=...)` of Python says what it leaves"
        ),
    },
    "read_log": NO_DELIMITER,
    "simulate_campaign": {
        **dict.fromkeys(
            ("gross", "gross_error", "gross_errors"), "change the rows of positions.csv"
        ),
        "hold": "campaigns have no slopes within holds",
        "no_time": "`interval` is none then",
        "robot_sigma_mgon": "`robot_sigma` takes it with its unit, as 5mgon",
        "samples_per_hold": "`n_samples` takes it",
        "sigma_unknown": "`sigma_known` says it, as --no-sigma-known",
    },
}
"""By the function of the command."""
