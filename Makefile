# The verbs of this project; `make` alone lists them. Everything runs in .venv, made from the pins in environment.txt, and every
# tool is called as a module: the start scripts inside .venv name their interpreter by its path, which fails where that holds a space.

PYTHON ?= python3
RUN := .venv/bin/python
READY := .venv/.ok
# A copied checkout works on itself, whichever one its .venv was made for.
export PYTHONPATH := $(CURDIR)
NBVAL := --nbval --nbval-sanitize-with=tests/nbval_sanitize.cfg --nbval-cell-timeout=3600 --nbval-kernel-startup-timeout=600

# A .venv whose Python is gone is made anew.
$(shell test -x $(RUN) || rm -f $(READY))

.DEFAULT_GOAL := help
.PHONY: help book lab student test test-lowest test-latest browser-test mutants refresh lock bench clean
.DELETE_ON_ERROR:

help:  ## list the targets
	@sed -n 's/^\([a-z -]*\):.*## \(.*\)/  make \1|\2/p' Makefile | awk -F'|' '{ printf "%-30s%s\n", $$1, $$2 }'

$(READY): environment.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.x")'
	@echo "Setting up .venv from environment.txt (the first time takes a few minutes)"
	@test -x $(RUN) || $(PYTHON) -m venv .venv
	@$(RUN) -m pip install --quiet --disable-pip-version-check -r environment.txt
	@$(RUN) -m pip install --quiet --disable-pip-version-check --no-deps -e .
	@$(RUN) -c 'import matplotlib.font_manager'  # builds the font cache, which would announce itself in a notebook
	@touch $@

book: $(READY)  ## run every notebook afresh and build the web book, which needs no network to be read
	@$(RUN) -m trackhelpers.suite book

lab: $(READY)  ## open the notebooks in JupyterLab (LAB= takes its options, --no-browser for one)
	@$(RUN) -m trackhelpers.suite lab $(LAB)

student: $(READY)  ## copy the notebooks without the exercises' solutions to build/student
	@$(RUN) -m trackhelpers.suite student

test: $(READY)  ## lint code and notebooks, run the unit tests (TESTS= takes pytest's options), compare every notebook's outputs with a fresh run
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	PYTHONPATH="$(CURDIR)/tests/quick:$(CURDIR)" $(RUN) -m pytest tests -n 2 $(TESTS)
	@if [ -z "$$(find notebooks -name '*.ipynb' -not -path '*/.*' 2>/dev/null)" ]; then echo "No notebooks to compare yet."; \
	else set -x; $(RUN) -m pytest $(NBVAL) notebooks -n 2 --dist loadscope --no-loadscope-reorder; fi

# Playwright drives the Chromium that is installed, under CHROMIUM= or as `chromium`. It is an extra that environment.txt need not hold:
# nothing else uses it.
browser-test: $(READY)  ## move the sliders and folds of book and JupyterLab in a browser (TESTS= takes pytest's options)
	@$(RUN) -m pip install --quiet --disable-pip-version-check "$$($(RUN) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["browser"])')"
	$(RUN) -m pytest tests_browser $(TESTS)

# An extra as well. An hour at low priority; MUTANTS="--only angles charts" asks of some folders, "--part 0/2" and "--part 1/2" share the work.
mutants: $(READY)  ## put 400 small faults into the package, one at a time: does the module's own folder of tests notice? (MUTANTS= takes options)
	@$(RUN) -m pip install --quiet --disable-pip-version-check "$$($(RUN) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["mutants"])')"
	nice $(RUN) -m tests_mutants $(MUTANTS)

refresh: $(READY)  ## run every notebook in place and store it normalised: a second run changes no byte
	@$(RUN) -m trackhelpers.suite refresh

lock: $(READY)  ## resolve pyproject.toml's ranges into environment.txt anew (UPGRADE= keeps the pins that still fit)
	@$(RUN) -m uv pip compile --quiet $(UPGRADE) --no-header $(EXTRAS) --universal pyproject.toml -o environment.txt
	@echo "environment.txt is written; the next make installs it."

UPGRADE ?= --upgrade
EXTRAS := $(foreach extra,fast lab book test bench lock,--extra $(extra))  # not the peers of the benchmarks, which are large

test-lowest test-latest: $(READY)  ## run the unit tests with the lowest, or the latest, versions that pyproject.toml allows (PYTHON=python3.13 for another Python), in an environment of their own below build
	@test -d $(OWN) || $(PYTHON) -m venv $(OWN)
	@$(RUN) -m uv pip compile --quiet --no-header --python $(OWN) $(EXTRAS) $(if $(findstring lowest,$@),--resolution lowest-direct,--upgrade) pyproject.toml -o $(OWN)/pins.txt
	@$(OWN)/bin/python -m pip install --quiet --disable-pip-version-check -r $(OWN)/pins.txt
	$(OWN)/bin/python -m pytest tests -n 2 --ignore tests/suite $(TESTS)

OWN = build/$@-$(notdir $(PYTHON))

bench: $(READY)  ## measure speed
	@$(RUN) -m benchmarks

clean:  ## remove what was built, but not .venv
	rm -rf build .pytest_cache .ruff_cache .hypothesis
	find . -path ./.venv -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +
