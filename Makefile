# `make run` and `make test` set up all they need from a fresh clone; a second call is quick.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
.DEFAULT_GOAL := help
.PHONY: help run test quick nightly prepared mutants check browser kernels site wheel format clean
WORKERS ?= 2# processes that run tests
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal --durations 10 --durations-min 1

help: ## this list
	@sed -n 's/^\([a-z]*\):.*## /make \1\t/p' Makefile

run: $(VENV)/installed ## start the app with the quadruped and open the browser
	@echo "Starting the page, in 1 to 3 s ..."
	@$(BIN)/python -m pgraph_app

test: prepared ## set up everything that the tests need, and run them: under ten minutes
	@echo "Running the tests in $(WORKERS) processes ..."
	@$(PYTEST)

quick: kernels ## the quick tests, without a browser: under a minute
	@$(PYTEST) -m quick

nightly: $(VENV)/installed-for-nights prepared ## every test, the long ones too, with new random cases
	@PGRAPH_EXPLORE=1 $(PYTEST) -m "nightly or not nightly"
	@PGRAPH_SLOW_PAGE="4 0.1" $(PYTEST) tests/app -k page # what depends on speed fails here
	@$(MAKE) --no-print-directory mutants

prepared: $(VENV)/installed-for-tests
	@$(MAKE) --no-print-directory -j 2 check browser kernels

mutants: $(VENV)/installed-for-tests ## which of 200 small faults in the sources the tests find: ten minutes
	@$(BIN)/python -m tests.mutants

check: $(VENV)/installed-for-tests ## format, lint, types and the direction of imports
	@echo "Checking format, types and imports, usually in 40 s ..."
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/oxfmt --check '**/*.js' '**/*.css'
	@mkdir -p build && sed -n '/^```python/,/^```/{/^```/!p;}' README.md > build/readme.py
	@$(BIN)/pyright --pythonpath $(BIN)/python
	@$(BIN)/lint-imports

browser: $(VENV)/installed-for-tests
	@.ci/browser $(BIN)/python

# Before the tests, so that their processes do not compile the same kernels at the same time.
kernels: $(VENV)/installed-for-tests
	@echo "Making machine code of the kernels, usually in 10 s ..."
	@$(BIN)/python -m pgraph_core.engine --all > /dev/null

site: $(VENV)/installed-for-nights ## the documents as a site with living figures, in build/site
	@$(BIN)/sphinx-build -q -W --keep-going docs build/site
	@echo "Open build/site/index.html"

wheel: $(VENV)/installed ## a wheel with machine code for the usual processors, in dist
	@$(BIN)/python -m pgraph_core.engine --machine-code
	@$(PIP) wheel --no-deps --wheel-dir dist .
	@ls dist/*.whl

format: $(VENV)/installed-for-tests ## put the source into the project's form
	@$(BIN)/ruff format .
	@$(BIN)/oxfmt '**/*.js' '**/*.css'
	@$(BIN)/ruff check --fix .

clean: ## remove the virtual environment and all caches
	@rm -rf $(VENV) .pytest_cache .ruff_cache .hypothesis .import_linter_cache *.egg-info build

# An interrupted set-up leaves no stamp and starts over; a changed pyproject.toml installs again.
$(VENV)/made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Pgraph needs Python 3.11 or newer; $(PYTHON) is not: name one with make PYTHON=python3.12 ..." >&2; exit 1; }
	@echo "Making a Python environment in $(VENV), usually in 3 s ..."
	@$(PYTHON) -m venv --clear $(VENV) || { echo "Python's venv is missing; on Debian: apt-get install python3-venv" >&2; exit 1; }
	@touch $@

$(VENV)/installed: $(VENV)/made pyproject.toml setup.py
	@echo "Installing Pgraph and its page into $(VENV): 150 MB to load, then usually 10 s ..."
	@$(PIP) install --no-compile --editable . # Python compiles what it imports: half as long
	@touch $@

$(VENV)/installed-for-tests: $(VENV)/made pyproject.toml setup.py
	@echo "Installing Pgraph and what its tests need into $(VENV), usually in 1 min ..."
	@$(PIP) install --editable '.[test]'
	@touch $(VENV)/installed $@

$(VENV)/installed-for-nights: $(VENV)/installed-for-tests
	@echo "Installing what the nightly tests and the site need into $(VENV), usually in 30 s ..."
	@$(PIP) install --editable '.[nightly]'
	@touch $(VENV)/installed $(VENV)/installed-for-tests $@
