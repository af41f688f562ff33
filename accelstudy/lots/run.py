"""The evaluation of a lot, from campaigns to files, as the command and the workflow run it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import Approach, get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say
from accelstudy.campaign.batch.config import BatchConfig
from accelstudy.campaign.batch.run import campaign_of
from accelstudy.campaign.calibration.fit import (
    usual_approach,
)
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import fit_base
from accelstudy.files.outputs import LOT, result_folder
from accelstudy.lots.calibrated import CalibratedLot
from accelstudy.lots.lot import weigh_lot
from accelstudy.lots.output import lot_document, write_lot
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

MIN_SENSORS = 2
"""Sensors of the smallest lot."""


def evaluate_lot(
    campaigns: Sequence[Campaign],
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
    cores: int = 1,
    left_out: Mapping[str, str] | None = None,
) -> CalibratedLot:
    """Say what the model of sensors of one type lacks, and calibrate each of them.

    Parameters
    ----------
    campaigns, model, approach, seed, cores : as in `weigh_lot`; campaigns of one name get their
        numbers behind it, and those of one log count once
    left_out : mapping of campaigns that could not be read to what is wrong with them; what cannot
        be judged by itself, as it leaves no redundancy, is left out as well

    Raises
    ------
    InputError
        If fewer than two campaigns can be judged.
    """
    usable, without = [], dict(left_out or {})
    names, first = (
        _own_names([campaign.name for campaign in campaigns], without),
        dict[bytes, str](),
    )
    for given, name in zip(campaigns, names, strict=True):
        campaign = replace(given, name=name)
        # Noise never repeats: the same numbers are the same log, whatever its folder.
        if (same := first.setdefault(campaign.forces.tobytes(), name)) != name:
            without[name] = f"{name}: has the readings of {same}; each sensor counts once"
            continue
        try:
            fit_base(campaign, model, approach or usual_approach(campaign))
            usable.append(campaign)
        except InputError as error:
            without[campaign.name] = str(error)
    if len(usable) < MIN_SENSORS:
        why = next(iter(without.values()), "")
        raise InputError(why or "a lot has two sensors or more; `diagnose` takes one")
    for name, why in without.items():
        say(f"not in the lot: {name}: {why.removeprefix(f'{name}: ')}")
    lot = weigh_lot(usable, model, approach, seed, cores)
    return CalibratedLot.of(lot, model, usable, approach, without)


def _own_names(given: Sequence[str], others: Collection[str]) -> list[str]:
    """Names of campaigns, no two alike: of equal ones each gets a number behind it."""
    names: list[str] = []
    for number, name in enumerate(given, start=1):
        if given.count(name) > 1 or name in others:
            numbered = (f"{name} ({k})" for k in count(number))
            name = next(one for one in numbered if one not in {*given, *others, *names})
        names.append(name)
    return names


def run_lot(
    batch: BatchConfig, folders: Sequence[str | Path], out: str | Path, cores: int = 1
) -> dict[str, Any]:
    """Evaluate all campaigns of a batch together; those that cannot be read are named.

    Parameters
    ----------
    batch : BatchConfig, with `lot`
    folders : paths, written by `run_task`, in the order of its tasks
    out : path of the folder to write
    cores : int, processes that work at once

    Returns
    -------
    dict
        The content of lot.json.
    """
    settings = batch.lot
    assert settings is not None
    campaigns, unread = [], {}
    for task, folder in zip(batch.tasks(), folders, strict=True):
        try:
            campaigns.append(campaign_of(task, folder))
        except InputError as error:
            unread[task.name] = str(error)
    model = get_model(settings.model or batch.model)
    approach = None if settings.approach is None else get_approach(settings.approach)
    with result_folder(out, LOT) as new:
        lot = evaluate_lot(campaigns, model, approach, settings.seed, cores, unread)
        content = lot_document(lot)
        write_lot(lot, content, new, out)
    return content
