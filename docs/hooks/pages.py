"""What pages take from the code: the comment <!-- catalogue.schemes() --> gives way to its text."""

import json
import re
from ast import literal_eval

import catalogue
import file_formats
import gallery
import help_texts
import quotes
import schemas
from mkdocs.structure.files import File

from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.diagnosis.file_format import DiagnosisDocument
from accelstudy.epochs.file_format import HistoryDocument
from accelstudy.lots.file_format import LotDocument
from accelstudy.planning.plan import PlanDocument
from accelstudy.sequential.advice import AdviceDocument
from accelstudy.study.result import SimulationDocument

MODULES = {
    module.__name__: module
    for module in (catalogue, file_formats, gallery, help_texts, quotes, schemas)
}
DOCUMENTS = (
    *(CalibrationDocument, HistoryDocument, LotDocument, DiagnosisDocument),
    *(PlanDocument, AdviceDocument, SimulationDocument),
)
"""Files whose JSON Schema can be downloaded."""
CALL = re.compile(r"^<!-- (\w+)\.(\w+)\((.*)\) -->$", re.MULTILINE)


def on_files(files, config):
    """Add the JSON Schemas of documents to the reference."""
    for one in DOCUMENTS:
        path = f"reference/{one.file.replace('.json', '.schema.json')}"
        content = json.dumps(one.model_json_schema(), indent=2, ensure_ascii=False)
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown, **_):
    """Put in what the code says where a page calls for it, and the numbers that the page quotes."""
    return quotes.fill(CALL.sub(_called, markdown))


def _called(call):
    module, function, arguments = call.groups()
    return getattr(MODULES[module], function)(*literal_eval(f"[{arguments}]")).strip("\n")
