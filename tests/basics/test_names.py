"""Names that become folders stay within them."""

import pytest

from accelstudy.basics.errors import InputError
from accelstudy.basics.names import check_path_name
from accelstudy.campaign.batch.config import parse_batch

BAD = ["../mydata", "/tmp/x", ".hidden", "-rf", "a/b", "a\\b", "{x}", "a b", "a\n", "", "x" * 300]


@pytest.mark.parametrize("name", BAD)
def test_names_of_folders(name):
    with pytest.raises(InputError) as error:
        check_path_name(name)
    assert len(str(error.value)) < 200
    with pytest.raises(InputError, match=r"config: batch: "):
        parse_batch({"batch": name, "campaigns": [{"campaign": "x"}]})
    with pytest.raises(InputError, match=r"config: campaigns.0.name: "):
        parse_batch({"batch": "x", "campaigns": [{"campaign": "x", "name": name}]})


def test_usual_names():
    for name in ("paper", "2024-05.b", "Prüfstand_1", "x" * 100):
        assert check_path_name(name) == name


def test_names_of_sources(tmp_path):
    """A folder is named after its source, which may be called anything; not too long, though."""
    sources = ["a{x}.csv", "-b c.csv", "'$(d)'.csv"]
    entries = [{"log": str(tmp_path / source)} for source in sources]
    tasks = parse_batch({"batch": "x", "campaigns": entries}).tasks()
    assert [task.name for task in tasks] == ["a-x-", "b-c", "d-"]
    (task,) = parse_batch({"batch": "x", "campaigns": [{"log": "x" * 300}]}).tasks()
    assert task.name == "x" * 100
