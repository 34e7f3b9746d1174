# `make figures` and `make test` need Python 3.11 or newer, make and pip's index; nothing else has to be there.
# Another Python: make test PYTHON=python3.13

PYTHON ?= python3
VENV := .venv
ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
else
BIN := $(VENV)/bin
endif
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: help figures test bench lint wheel clean

help:
	@echo "make figures   every figure and claim of the publications, and results/REPORT.md"
	@echo "make test      run the tests"
	@echo "make bench     measure the speed beside its bars"
	@echo "make lint      ruff and mypy"
	@echo "make wheel     build the wheel into dist/"
	@echo "make clean     remove .venv and everything built; results/ stays"

figures: $(VENV)/.installed
	$(BIN)/hgorun figures --report

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest $(ARGS)

bench: $(VENV)/.installed-dev
	$(BIN)/python tests/benchmarks/bench.py $(ARGS)

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

wheel: $(VENV)/.installed-dev
	$(BIN)/python -m build --wheel

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find hgorun tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps are written last, so an interrupted installation is made again. What is installed is the checkout
# itself (-e): a changed experiment or observer needs no new installation.
$(VENV)/.installed: pyproject.toml | $(VENV)
	$(PIP) -e .
	touch $@

$(VENV)/.installed-dev: pyproject.toml | $(VENV)
	$(PIP) -e ".[dev]"
	touch $(VENV)/.installed $@

$(VENV):
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, this is " + sys.version.split()[0] \
	  + ": make PYTHON=python3.11" if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }
