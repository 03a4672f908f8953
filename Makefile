# make demo [SECONDS=20]   a simulated robot finds itself, in a browser; Ctrl-C stops it
# make test                everything that must hold before a change is done

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

demo: $(READY)
	@$(BIN)/lodeline demo $(if $(SECONDS),--seconds $(SECONDS))

test: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/codespell
	$(BIN)/mypy
	$(BIN)/pytest -m "not live and not paired" -n 2
	$(BIN)/pytest -m paired -n 2 --dist loadfile
	$(BIN)/pytest -m live

$(READY): pyproject.toml constraints.txt
	@python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "Lodeline needs python3 >= 3.11, this is $$(python3 --version)"; exit 1; }
	@python3 -m venv $(VENV) \
		|| { echo "python3 has no venv module: install it (Debian: apt install python3-venv)"; exit 1; }
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

.PHONY: demo test
