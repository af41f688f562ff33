"""Notebooks: executed while the site is built, shown as pages, and ready to be downloaded.

In git each is a script, without any output. Nothing of an execution is kept.
"""

import os
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import jupytext
from mkdocs.structure.files import File
from nbclient import NotebookClient
from nbconvert import MarkdownExporter
from traitlets.config import Config

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
DOWNLOAD = "\n\n[Download this page as a notebook]({name}.ipynb){{ download }}\n"
KERNEL = {"name": "python3", "display_name": "Python 3", "language": "python"}
FIGURES = ["--InlineBackend.figure_formats=svg"]


def page(name, notebook):
    """The page of a notebook and its figures, by their paths."""
    with TemporaryDirectory() as folder:
        # A file in place of the network, of which nothing is needed, not even within the machine.
        connection = Config({"KernelManager": {"transport": "ipc", "ip": f"{folder}/kernel"}})
        notebook = NotebookClient(
            notebook, extra_arguments=FIGURES, config=connection,
            resources={"metadata": {"path": folder}},
        ).execute()  # fmt: skip
    text, resources = MarkdownExporter().from_notebook_node(
        notebook, {"output_files_dir": name, "unique_key": "figure"}
    )
    title, rest = text.lstrip().split("\n", 1)
    # Tables look as those of all pages.
    rest = re.sub(r"<style scoped>.*?</style>", "", rest, flags=re.DOTALL)
    rest = re.sub(r'<table[^>]* class="dataframe">', "<table>", rest)
    rest = rest.replace("![svg](", "![figure](")
    return {f"{name}.md": title + DOWNLOAD.format(name=name) + rest, **resources["outputs"]}


def on_files(files, config):
    """Add a page, its figures, and the notebook without outputs for each script."""
    notebooks = {path.stem: jupytext.read(path) for path in sorted(NOTEBOOKS.glob("*.py"))}
    for notebook in notebooks.values():
        notebook.metadata = {"kernelspec": KERNEL}
    plain = {f"{name}.ipynb": jupytext.writes(each, "ipynb") for name, each in notebooks.items()}
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        pages = threads.map(page, notebooks, notebooks.values())
        for made in (plain, *pages):
            for path, content in made.items():
                files.append(File.generated(config, f"notebooks/{path}", content=content))
    return files
