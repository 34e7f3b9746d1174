# `make figures` and `make test` need Python 3.11 or newer, make and pip's index; nothing else has to be there.
# Another Python: make test PYTHON=python3.13

PYTHON ?= python3
VENV := .venv
ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
else
BIN := $(VENV)/bin
endif

# Environments are made and filled by Python's own tools, or, with UV=uv, by uv in a tenth of the time.
ENVIRONMENT = $(if $(UV),$(UV) venv --quiet --seed --python $(1) $(2),$(1) -m venv $(2))
INSTALL = $(if $(UV),$(UV) pip install --quiet --python $(1)/python,$(1)/python -m pip install --quiet --disable-pip-version-check)

LOWEST := .venv-lowest
SMOKE := tests/test_code.py tests/test_packaging.py tests/config tests/native tests/result tests/commands/test_cli.py tests/simulation/test_naive.py
LOWEST_PYTHON ?= $(or $(shell command -v python3.11),$(PYTHON))

.PHONY: help figures images benchmark test test-lowest test-newer newer coverage bench lint style types docs dist sbom wheel clean

help:
	@echo "make figures   every figure and claim of the publications, and results/REPORT.md"
	@echo "make images    the pictures of the documentation, in docs/images/"
	@echo "make benchmark compare observers on several plants, in results/benchmark/: minutes; continues where it was"
	@echo "make test      run the tests; the fast ones: make test ARGS='-m \"not slow\"'"
	@echo "make test-lowest  the fast tests with the lowest versions that pyproject.toml permits"
	@echo "make test-newer  a part of the tests with each newer Python that pyproject.toml names and this machine has; one of them: TURN=1"
	@echo "make coverage  run the tests, list the lines and branches of each file that they leave out"
	@echo "make bench     measure the speed beside its bars"
	@echo "make lint      ruff and mypy, which are \`make style\` and \`make types\`"
	@echo "make docs      the documentation as a site, in build/docs; what is not right stops it"
	@echo "make dist      build source distribution and wheel into dist/, the same bytes each time"
	@echo "make sbom      what an installation consists of (CycloneDX) into dist/, and whether advisories about it are known"
	@echo "make wheel     build the wheel into dist/"
	@echo "make clean     remove .venv and everything built; results/ stays"

figures: $(VENV)/.installed
	$(BIN)/hgorun figures --report

images: $(VENV)/.installed
	$(BIN)/python tools/images.py $(ARGS)

benchmark: $(VENV)/.installed
	$(BIN)/hgorun benchmark experiments/benchmark/benchmark.yaml

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest $(ARGS)

test-lowest: $(LOWEST)/.installed
	$(subst $(VENV),$(LOWEST),$(BIN))/python -m pytest -m "not slow" $(ARGS)

test-newer: newer
	$(PYTHON) tools/pythons.py $(TURN) | while read -r version python; do \
	  { .venv-$$version/bin/python --version \
	    && .venv-$$version/bin/python -m pytest --one-case -m "not slow" $(SMOKE) $(ARGS) </dev/null; } || exit 1; \
	done

newer: pyproject.toml
	$(PYTHON) tools/pythons.py $(TURN) | while read -r version python; do \
	  [ .venv-$$version/.installed -nt pyproject.toml ] || { rm -rf .venv-$$version && $(call ENVIRONMENT,$$python,.venv-$$version) \
	    && $(call INSTALL,.venv-$$version/bin) -e ".[test]" \
	    && touch .venv-$$version/.installed; } || exit 1; \
	done

coverage: $(VENV)/.installed-dev
	$(BIN)/python -m pytest --cov --cov-report=json $(ARGS)
	$(BIN)/python tools/coverage_floor.py coverage.json $(FLOORS)

bench: $(VENV)/.installed-dev
	$(BIN)/python tests/benchmarks/bench.py $(ARGS)

lint: style types

style: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	$(BIN)/mypy

docs: $(VENV)/.installed-dev
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d build/doctrees docs build/docs
	$(BIN)/python tools/follow_links.py build/docs

# The time in the archives is that of the last commit; where there is none, the fixed one of the build tool.
dist: export SOURCE_DATE_EPOCH ?= $(shell git log -1 --format=%ct 2>/dev/null)
dist: $(VENV)/.installed-dev
	[ -n "$$SOURCE_DATE_EPOCH" ] || unset SOURCE_DATE_EPOCH; $(BIN)/python -m build $(ARGS)

# Of a clean environment with nothing but hgorun in it; the tools have one of their own.
sbom: wheel
	rm -rf build/sbom
	$(PYTHON) -m venv build/sbom/hgorun
	build/sbom/hgorun/bin/python -m pip install --quiet dist/hgorun-*.whl
	$(PYTHON) -m venv build/sbom/tools
	sed -n 's/^release = \[\(.*\)\]/\1/p' pyproject.toml | tr -d ',' | xargs build/sbom/tools/bin/python -m pip install --quiet
	build/sbom/tools/bin/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible --validate --of JSON \
	  --output-file dist/hgorun.cdx.json build/sbom/hgorun/bin/python
	$(PYTHON) tools/audit.py build/sbom/tools/bin/pip-audit build/sbom/hgorun

wheel:
	$(MAKE) dist ARGS="--wheel $(ARGS)"

clean:
	rm -rf $(VENV) $(LOWEST) .venv-3.* build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage coverage.json
	find hgorun tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps are written last, so an interrupted installation is made again. What is installed is the checkout
# itself (-e): a changed experiment or observer needs no new installation.
$(VENV)/.installed: pyproject.toml | $(VENV)
	$(call INSTALL,$(BIN)) -e .
	touch $@

$(VENV)/.installed-dev: pyproject.toml | $(VENV)
	$(call INSTALL,$(BIN)) -e ".[dev]"
	touch $(VENV)/.installed $@

$(LOWEST)/.installed: pyproject.toml tools/lowest.py
	rm -rf $(LOWEST)
	$(call ENVIRONMENT,$(LOWEST_PYTHON),$(LOWEST))
	$(LOWEST_PYTHON) tools/lowest.py >$(LOWEST)/constraints.txt
	$(call INSTALL,$(subst $(VENV),$(LOWEST),$(BIN))) -c $(LOWEST)/constraints.txt -e ".[dev]"
	touch $@

$(VENV):
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, this is " + sys.version.split()[0] \
	  + ": make PYTHON=python3.11" if sys.version_info < (3, 11) else 0)'
	$(call ENVIRONMENT,$(PYTHON),$(VENV)) || { rm -rf $(VENV); exit 1; }
