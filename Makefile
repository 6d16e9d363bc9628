# demo test lint bench soak docs: what each does stands beside it. `make demo` and `make test` make their own environment.
export PYTHONSAFEPATH = 1
VENV ?= .venv
BIN = $(VENV)/bin
OUT ?= out
LOWEST ?= tests/geo tests/coverage tests/exporters tests/mission/test_planfile.py tests/mission/test_cover.py tests/physics/test_simulate.py \
	tests/campaign/test_summary.py tests/house/test_first_contact.py tests/house/test_assign_cli.py --ignore tests/exporters/test_mavsdk.py
ALL_CORES = -n logical --maxprocesses 8 --dist worksteal

.PHONY: demo test lint bench bench-coverage bench-physics bench-assign bench-triage soak docs docs-pictures docs-site lowest clean

$(VENV)/installed: pyproject.toml
	python3 -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[charts,cluster]' --group test
	touch $@

demo: $(VENV)/installed  ## plan, simulate, draw and export a real site
	$(BIN)/quarterdeck plan data/west_ant_island.geojson -o $(OUT)/west_ant_island.plan.geojson --force
	$(BIN)/quarterdeck simulate $(OUT)/west_ant_island.plan.geojson --report $(OUT)/report.json --rrd $(OUT)/run.rrd --picture $(OUT)/run.png --force
	$(BIN)/quarterdeck export $(OUT)/west_ant_island.plan.geojson --to qgc-wpl,geojson,png,rerun -o $(OUT)/ --force

test: lint  ## everything that must hold
	$(BIN)/python -m pytest $(ALL_CORES) --cov --cov-report=term:skip-covered

lint: $(VENV)/installed  ## style, types and layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: bench-coverage bench-physics bench-assign bench-triage  ## ratios, not tests: minutes

bench-coverage: $(VENV)/installed
	$(BIN)/python benchmarks/coverage_table.py

bench-physics: $(VENV)/installed  ## PVS=, GPD=: checkouts of PythonVehicleSimulator, gym-pybullet-drones to run beside
	$(BIN)/python benchmarks/simulation.py --table $(if $(PVS),--peer pvs=$(PVS)) $(if $(GPD),--peer gpd=$(GPD))

bench-assign: $(VENV)/installed
	$(BIN)/python -m pip install --quiet pyvrp ortools
	$(BIN)/python benchmarks/assignment.py --table

bench-triage: $(VENV)/installed
	$(BIN)/python benchmarks/triage.py

soak: $(VENV)/installed  ## damaged input by the hundred thousand: hours
	$(BIN)/python -m pytest tests/soak/test_soak.py --soak 100000

docs: $(VENV)/installed  ## the pages that are generated: a minute or two
	$(BIN)/python docs/generate.py

docs-pictures: $(VENV)/installed  ## the pictures of the pages, but those that the tutorials' own commands make
	$(BIN)/python docs/draw.py

docs-site: $(VENV)/installed  ## docs/ as a site in out/site
	$(BIN)/python -m mkdocs build --strict

lowest:  ## tests on the lowest versions that pyproject.toml allows, in an environment of its own
	.ci/lowest .venv-lowest -q $(ALL_CORES) $(LOWEST)

clean:
	rm -rf $(VENV) $(OUT) build dist *.egg-info
