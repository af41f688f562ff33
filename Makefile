PYTHON ?= python3
CORES ?= 2
CONFIG ?= config/config.yaml
HIDDEN ?= studies/hidden/config/hidden-effects.yaml
FOLDER ?= resources/public

SHELL := bash
ENV := .venv
READY := $(ENV)/.ready
TEST = pytest --numprocesses $(CORES) --dist loadfile --no-loadscope-reorder
OLD_NUMPY := NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4 AVX512_ICL AVX512_SPR"
# The lock is complete. Resolving it again, pip alone would miss the hash of coverage with its extra.
INSTALL := pip install --quiet --no-deps --no-build-isolation --require-hashes --requirement requirements.lock

# The workflow's shell commands find the environment's python by the path alone.
export PATH := $(CURDIR)/$(ENV)/bin:$(PATH)
export VIRTUAL_ENV := $(CURDIR)/$(ENV)
export PYTHONNOUSERSITE := 1
unexport PYTHONPATH PYTHONHOME PYTHONDONTWRITEBYTECODE
# Where the home folder cannot be written, what tools keep there is kept here.
ifneq ($(shell mkdir -p "$${XDG_CACHE_HOME:-$$HOME/.cache}" 2>&- && test -w "$${XDG_CACHE_HOME:-$$HOME/.cache}" && echo yes),yes)
export XDG_CACHE_HOME := $(CURDIR)/.cache
export MPLCONFIGDIR := $(CURDIR)/.cache/matplotlib
endif
# Snakemake fills the cores with jobs; threads within a job would only compete with them.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
export MKL_NUM_THREADS := 1

.PHONY: help env test tests golden golden-renew coverage test-processors test-processors-part test-breaks smoke reproduce anew unlock report positions hidden-effects hidden-docs real-noise optimal-schemes pictures benchmarks docs wheel lint style types lock clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "%-18s%s\n", $$1, $$2 }' Makefile
	@echo 'PYTHON=python3.12 chooses the interpreter of a new environment, CORES=8 the cores used,'
	@echo 'CONFIG=config/smoke.yaml the study of `make anew`,'
	@echo 'HIDDEN=my.yaml the study of `make hidden-effects`.'

env: $(READY) ## make the environment, from locked versions, in .venv

# What is quick comes first; types are checked beside the tests, which alone leave a core idle.
test: style ## check and test the package
	$(MAKE) --jobs 2 types tests

tests: $(READY)
	$(TEST)

# Of all parts in tests/golden, or of PART; `make test` compares those that take a minute together.
golden: $(READY) ## compare what commands and studies tell with what is kept of them
	CORES=$(CORES) python tests/helpers/golden.py $(PART)

golden-renew: $(READY) ## keep what they tell now, of one part: make golden-renew PART=readme
	CORES=$(CORES) python tests/helpers/golden.py --renew $(PART)

# Apart from `make test`, as measuring takes as long as all tests.
coverage: $(READY) ## test the package, and list the lines that no test runs
	$(TEST) --cov

# Libraries choose their instructions by the processor; they are told to choose those of others.
test-processors: $(READY) ## run all tests with the instructions of other processors
	for other in OPENBLAS_CORETYPE=Haswell OPENBLAS_CORETYPE=Nehalem $(OLD_NUMPY); do \
	  echo "$$other"; env "$$other" $(TEST) || exit; done

test-processors-part: $(READY) ## run a few tests with the instructions of an old processor
	OPENBLAS_CORETYPE=Nehalem $(OLD_NUMPY) $(TEST) $(addprefix tests/,planning/test_plan.py \
	  repository/test_examples.py design/test_schemes.py repository/test_pole.py \
	  simulation/test_simulation.py)

test-breaks: $(READY) ## break a copy of the package on purpose, and see that tests notice
	python tests/helpers/breaking.py

smoke: $(READY) ## run the whole workflow on a small configuration
	snakemake --cores $(CORES) --configfile config/smoke.yaml
	snakemake --cores $(CORES) --snakefile studies/hidden/hidden.smk --configfile $(HIDDEN) studies/hidden/config/hidden-smoke.yaml
	python tests/helpers/pictures.py check

reproduce: $(READY) ## reproduce the paper
	snakemake --cores $(CORES)

anew: $(READY) ## make all results of a study again, whatever is there of them
	snakemake --cores $(CORES) --configfile $(CONFIG) --forceall

unlock: $(READY) ## remove the lock of a run that was killed
	snakemake --unlock

report: reproduce ## make results/paper/report.zip, to be opened in a browser
	snakemake --cores $(CORES) --report results/paper/report.zip

positions: $(READY) ## study how good schemes are, and sessions that stop by themselves
	python -m studies.positions results/positions

hidden-effects: $(READY) ## study how well the diagnosis finds what is hidden
	snakemake --cores $(CORES) --snakefile studies/hidden/hidden.smk --configfile $(HIDDEN)

# Of the study as it stands in config/, whatever HIDDEN is.
hidden-docs: $(READY) ## study hidden effects, and take score and figures into docs
	$(MAKE) hidden-effects HIDDEN=studies/hidden/config/hidden-effects.yaml
	cp results/hidden-effects/score.md docs/guides/hidden-effects-score.md
	for name in naming methods sets calibration outside; do \
	  cp results/hidden-effects/figures/$$name.png docs/figures/hidden-$$name.png; done

# Of the logs in FOLDER, or downloaded to it: make real-noise FOLDER=~/logs
real-noise: $(READY) ## put known effects into public logs, find them again, and take the score into docs
	snakemake --cores $(CORES) --snakefile studies/hidden/hidden.smk --configfile studies/hidden/config/real-noise.yaml --config public_folder=$(FOLDER)
	cp results/real-noise/score.md docs/guides/real-noise-score.md

pictures: reproduce ## make the pictures of reports, studies and tutorials in docs anew
	snakemake --cores $(CORES) --configfile config/smoke.yaml
	python tests/helpers/example_helpers.py
	python tests/helpers/pictures.py

optimal-schemes: $(READY) ## search the table of optimal schemes anew
	python tests/helpers/optimal_schemes.py

benchmarks: $(READY) ## measure the speed, and take the tables into docs
	python benchmarks/run.py docs/guides/speed.md

docs: $(READY) ## build the documentation in site/, offline; open site/index.html
	NO_MKDOCS_2_WARNING=1 mkdocs build --strict

wheel: $(READY) ## build the package in dist/, with the workflow in it
	python -m hatchling build --target wheel

# Snakemake's own check of the workflows is a test, as starting it takes longer.
lint: style types ## check style and types

style: $(READY)
	ruff check
	ruff format --check
	snakefmt --check Snakefile workflow studies accelstudy/study/template

types: $(READY)
	mypy

lock: $(READY) ## lock the newest versions that pyproject.toml allows
	uv lock --upgrade --default-index https://pypi.org/simple
	uv export --quiet --frozen --no-emit-project --all-groups --all-extras --output-file requirements.lock
	uv export --quiet --frozen --no-emit-project --only-group build --output-file requirements-build.lock

clean: ## remove the environment and all caches, but no results
	rm -rf $(ENV) .cache .coverage* .*_cache .hypothesis
	find accelstudy studies tests -name __pycache__ -prune -exec rm -r {} +

# The stamp comes last: an environment without it is unfinished and made anew. The old one goes
# first: while it is there, it is what `python3` names. uv is fast, but pip is what a machine with
# an index of its own has configured.
$(READY): pyproject.toml requirements.lock requirements-build.lock
	rm -rf $(ENV)
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(None if (3, 11) <= v < (3, 14) else \
	  "accelstudy needs Python 3.11, 3.12 or 3.13, not %d.%d: make PYTHON=python3.12" % v)'
	$(PYTHON) -m venv $(ENV)
	python -m pip install --quiet --require-hashes --requirement requirements-build.lock
	uv $(INSTALL) --compile-bytecode || python -m $(INSTALL)
	uv pip install --quiet --no-build-isolation --no-deps --editable .
	touch $@
