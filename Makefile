# Everything a person types here, from a new clone with Python 3.11 or newer and make:
#
#   make demo      simulate the example print head and write a report
#   make test      run the tests
#
# The environment is made in .venv on first use. PYTHON=python3.12 chooses the interpreter.

PYTHON   ?= python3
VENV     := .venv
BIN      := $(VENV)/bin
DEMO     := runs/demo
EXAMPLES := src/detent/examples
PYTEST   := $(BIN)/python -m pytest
# An interpreter named by the person replaces the one that an older .venv was made with.
CHOSEN := $(if $(filter-out file default undefined,$(origin PYTHON)),--chosen)

# tools/environment.py returns at once when the environment is already what pyproject.toml asks for.
define environment
@command -v '$(PYTHON)' >/dev/null || { echo "$(PYTHON) is not installed; detent needs Python 3.11 or newer (Debian: apt install python3 python3-venv)" >&2; exit 2; }
@'$(PYTHON)' tools/environment.py $(CHOSEN) '$(VENV)' $(1)
endef

# Every process of the tests imports the same files: their bytecode is kept, even where the surroundings forbid it.
export PYTHONDONTWRITEBYTECODE :=

.DEFAULT_GOAL := help
# The commands share one environment: under `make -j` two of them must not install into it at once.
.NOTPARALLEL:
.PHONY: help demo test test-wide test-long test-lowest tried lock locked bench bench-smoke coverage lint format types imports docs figures check clean venv-base venv-test venv-dev

help: ## this list
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1#/' | awk -F'#' '{ printf "%-20s %s\n", $$1, $$2 }'

venv-base:
	$(call environment)

venv-test:
	$(call environment,test)

venv-dev:
	$(call environment,dev)

demo: venv-base ## simulate the example print head printing a letter; say where the report is
	@mkdir -p $(DEMO)
	$(BIN)/detent run $(EXAMPLES)/print_head.toml --job $(EXAMPLES)/letter.txt --output $(DEMO)
	@echo "Open $(CURDIR)/$(DEMO)/report.html in a browser."

# Files go whole to one process per processor: what a file prepares is prepared once. They go in the order that
# tests/conftest.py gives them, not by how many tests they hold: the longest have few.
WHOLE_FILES := -n auto --dist loadfile --no-loadscope-reorder
# MEASURED=yes: which lines the unit tests reach is written to these files, for `make coverage`; it takes half as long
# again for these tests, and spares doing them twice.
REACHED     := .coverage.tests
test: venv-test ## the tests, without those that take long
	$(if $(MEASURED),rm -f $(REACHED).* && COVERAGE_FILE=$(REACHED) )$(PYTEST) $(if $(MEASURED),-p tests.measured) \
	    $(WHOLE_FILES) -p no:benchmark $(PYTEST_ARGS)

test-wide: venv-test ## thousands of numbered cases, dozens of logs, other processors' kernels
	$(PYTEST) -m "wide and not long" $(WHOLE_FILES) -p no:benchmark $(PYTEST_ARGS)

test-long: venv-test ## the tests that take long
	$(PYTEST) -m long $(PYTEST_ARGS)

# Of every dependency the oldest release that pyproject.toml allows and that has a wheel for this Python. Old releases
# warn of what new ones of their own dependencies will drop: that is theirs.
LOWEST  := .venv-lowest
OLDEST  := $(addprefix tests/unit/,axisfile cli files page record test_axis.py test_errors.py test_units.py) \
           $(wildcard tests/unit/test_cli*.py $(addprefix tests/unit/methods/,*.py */test_schema.py */test_build.py))
test-lowest: venv-dev ## files, pages, commands and a run of each method, with the oldest dependencies allowed
	$(BIN)/uv venv --quiet --clear --seed --python '$(PYTHON)' $(LOWEST)
	$(BIN)/uv pip install --quiet --python $(LOWEST) --resolution lowest-direct --only-binary :all: --editable '.[oldest]'
	$(LOWEST)/bin/python -m pytest $(WHOLE_FILES) -p no:benchmark \
	    -m "not long and not wide and not process" -W default::DeprecationWarning $(OLDEST) $(PYTEST_ARGS)

LOCK := requirements-dev.txt
lock: venv-dev ## write the versions of all that development needs, with their checksums, to requirements-dev.txt
	env -u UV_INDEX -u UV_INDEX_URL -u UV_EXTRA_INDEX_URL -u UV_FIND_LINKS $(BIN)/uv pip compile --no-config --quiet \
	    --default-index https://pypi.org/simple --universal --python-version 3.11 --only-binary :all: --upgrade \
	    --generate-hashes --extra dev --custom-compile-command 'make lock' --output-file $(LOCK) pyproject.toml

locked: venv-dev ## bring .venv to the versions of requirements-dev.txt, and to nothing else
	$(BIN)/uv pip sync --quiet --python $(VENV) --require-hashes $(LOCK)
	$(BIN)/uv pip install --quiet --python $(VENV) --no-deps --editable .

tried: venv-test ## attack detent: kills, full disks, damaged files, hostile text; the figures of the page about that
	$(PYTEST) -m "not bench" $(WHOLE_FILES) -p no:benchmark --tried docs/tried.toml $(PYTEST_ARGS)

bench: venv-test ## how fast: nanoseconds per tick, seconds to compile, milliseconds to start
	$(PYTEST) -m bench tests/bench --benchmark-columns=min,median,max,rounds $(PYTEST_ARGS)

bench-smoke: venv-test ## run every benchmark once, without measuring
	$(PYTEST) -m bench tests/bench --benchmark-disable $(WHOLE_FILES) $(PYTEST_ARGS)

# Compiled code is invisible to coverage: the tests of the steps run as plain Python, but for those that simulate too
# long. All other unit tests run compiled, and coverage looks on while `make test` does them: where that was before the
# last edit, it does them again. Beside the steps run the panel's tests of the specification, and the faces, processes
# of their own, with the tests of their clients: these wait more than they compute, and are waited for by an axis whose
# loop may not come late, so that the steps, which nobody waits for, are nice to them.
BLOCKS   := $(addprefix tests/unit/,control drive planning plant sensing)
STEPS    := $(BLOCKS) $(addprefix tests/unit/,kernel $(addprefix operate/test_,drivers.py loop.py watchdog.py)) \
            $(wildcard $(addprefix tests/unit/methods/*/test_,controller.py live*.py plant.py system*.py))
PANEL    := _49_ or _50_ or _51_ or _52_ or _53_
SEEN     := not long and not wide and not bench
COVER    := $(BIN)/python -m coverage run
$(REACHED).gw0: $(shell find src/detent tests -name '*.py')
	$(MAKE) test MEASURED=yes
coverage: venv-test $(REACHED).gw0 ## which lines and branches the unit tests reach
	rm -f .coverage.faces.* .coverage.steps.*
	(COVERAGE_FILE=$(CURDIR)/.coverage.faces $(COVER) --rcfile=$(CURDIR)/tests/faces.coveragerc \
	        -m pytest -m "$(SEEN)" -k "not test_29 and not test_31" tests/acceptance/test_faces.py $(PYTEST_ARGS) && \
	    COVERAGE_FILE=.coverage.panel $(COVER) \
	        -m pytest -m "$(SEEN) and not process" -k "$(PANEL)" tests/acceptance/test_live.py $(PYTEST_ARGS)) & beside=$$!; \
	NUMBA_DISABLE_JIT=1 COVERAGE_FILE=.coverage.steps nice $(PYTEST) -p tests.measured $(WHOLE_FILES) -p no:benchmark \
	    -m "$(SEEN) and not compiled and not process" $(STEPS) $(PYTEST_ARGS); steps=$$?; \
	wait $$beside && test $$steps = 0
	$(BIN)/python -m coverage combine $(REACHED).* .coverage.steps.* .coverage.panel .coverage.faces.*
	$(BIN)/python -m coverage report

lint: venv-dev ## ruff: rules and layout
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: venv-dev ## let ruff lay out the code
	$(BIN)/ruff format .

types: venv-dev ## pyright, strict on src
	$(BIN)/pyright

imports: venv-dev ## do the rooms import downwards only?
	$(BIN)/lint-imports

docs: venv-dev ## build the documentation, pictures of the panel with it; a warning is an error
	$(BIN)/python docs/pictures.py
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html
	@! grep -rlE '<(script|img|link)[^>]*(src|href)="(https?:)?//' docs/_build/html --include='*.html' || { echo "these pages load something from the network" >&2; exit 1; }
	@echo "Documentation: $(CURDIR)/docs/_build/html/index.html"

figures: venv-test ## draw the figures of the documentation anew, and replace those that look different
	$(BIN)/python docs/draw.py

check: lint types imports test docs bench-smoke ## all that a change must pass, but for the long tests

clean: ## remove the environment and everything made
	rm -rf $(VENV) $(VENV).lock $(LOWEST) docs/_build runs .pytest_cache .hypothesis .benchmarks .ruff_cache .import_linter_cache .coverage* htmlcov
