"""All keys of all configurations."""

from markdown_text import page
from schemas import blocks

from accelstudy.campaign.batch.config import BatchConfig
from accelstudy.diagnosis.round_trip import RoundTrip
from accelstudy.study.config import config_schema
from studies.hidden.real_noise import RealNoiseConfig
from studies.hidden.study import HiddenConfig


def configuration():
    """All keys of all configurations."""
    return page(
        blocks(config_schema(), "A study"),
        blocks(BatchConfig.model_json_schema(), "A batch of campaigns", "batch: "),
        blocks(RoundTrip.model_json_schema(), "A hidden effect, found again", "round trip: "),
        blocks(HiddenConfig.model_json_schema(), "A study of hidden effects", "hidden: "),
        blocks(RealNoiseConfig.model_json_schema(), "A study with real noise", "real noise: "),
    )
