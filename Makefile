# run: the main job; test: everything that must hold; quick: what tells within minutes whether
# something broke. All install what is missing first.
CORES ?= 2
BIN := .venv/bin

.PHONY: run quick test test-all setup lint format docs site lock coverage peers reproduce hooks

# Tests run side by side: threads of one would wait for those of another.
quick test test-all coverage: export OPENBLAS_NUM_THREADS := 1

run: setup
	$(BIN)/snakemake --cores $(CORES)

quick: setup
	$(BIN)/python -m pytest -q -n $(CORES) --dist loadfile -m "not whole and not long"

test: setup lint
	@tools/browser
	$(BIN)/python -m pytest -q -n $(CORES) --dist loadfile -m "not long"

# Besides, what takes minutes each or needs a cluster.
test-all: setup lint
	@tools/browser
	$(BIN)/python -m pytest -q -n $(CORES) --dist loadfile

setup:
	@tools/setup

lint:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile rules
	$(BIN)/snakemake --lint
	PYTHONPATH=scripts $(BIN)/lint-imports --no-cache
	$(BIN)/python tools/dead_code.py
	$(BIN)/mypy

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile rules

# Lines that unit tests, closed forms and the jobs of small runs reach; tracing makes jobs slow.
# Which test reached a line and how long each took stays for tools/mutants.py.
coverage: setup
	$(BIN)/python -m pytest -q -n $(CORES) --timeout 6000 --cov --cov-report=term --cov-context=test \
		--junitxml=.coverage-tests.xml tests/unit tests/physics tests/workflow/test_small_*.py

# Other programs on the shots of the default run, each in an environment of its own.
peers: setup
	$(BIN)/snakemake --cores $(CORES) -- results/virtual-apple/scan/shots.parquet
	$(BIN)/python benchmarks/peers.py virtual-apple
	$(BIN)/python benchmarks/peers_rami.py

# A small experiment twice, with one core and with two; ARGUMENTS=--write renews docs/data/checksums.csv.
reproduce: setup
	PYTHONPATH=scripts $(BIN)/python tools/reproduce.py $(ARGUMENTS)

hooks: setup
	$(BIN)/pre-commit install

docs: setup
	PYTHONPATH=scripts $(BIN)/python -m dapple.config.docs
	$(BIN)/python tools/pages.py
	$(BIN)/python tools/rule_graph.py

# The pages as a website, without the network; a warning is an error.
site: setup
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html

lock: setup
	$(BIN)/uv pip compile pyproject.toml --extra cluster --extra storage --group dev --generate-hashes --universal --no-header --quiet -o requirements.lock
