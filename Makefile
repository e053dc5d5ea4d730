# What a person and CI run. Everything needed beyond Rust, a C compiler, Python 3.11
# or later and make is installed into .venv by the rules below.

PYTHON ?= python3
VENV := .venv
IN_VENV := $(VENV)/bin/

ZIG := target/platforms/zig

# Which cargo-fuzz; it is compiled into this folder, not installed.
FUZZER := cargo-fuzz@0.13.1
TOOLS := $(CURDIR)/target/tools

.PHONY: build fmu-linux64 fmu-all wheel test-wheel compare-platforms test test-rust test-python browser demo bench fuzz soak memcheck lint package clean

# No path of this machine in what is built; the same flags everywhere, so that nothing is compiled twice.
export CARGO_ENCODED_RUSTFLAGS := $(shell tools/platforms/remap.sh)

# The program and the FMU binaries, in one build: they share their crates. PROGRAM says another build of the
# program, as `.ci/run` does; the FMU binaries are then built by themselves, without what tests ask for.
FMUS := --package ftc-controller-fmu --package ftc-plant-fmu

build:
ifdef PROGRAM
	cargo build --release $(PROGRAM)
	cargo build --release $(FMUS)
else
	cargo build --release --package ftc-fmu $(FMUS)
endif
	tools/platforms/native.sh

# What `make fmu-all` builds, and which FMU binaries the wheel carries (docs/platforms.md).
PLATFORMS ?= linux64 win64 aarch64-linux

# FMU binaries beyond those for this machine; `ftc-fmu export` packs whatever is built and is not
# older than the program. The first needs glibc 2.17 only; the others see docs/platforms.md.
fmu-linux64: build $(ZIG)/ready
	PATH="$(CURDIR)/$(ZIG)/bin:$$PATH" tools/platforms/build.sh linux64

fmu-all: build $(ZIG)/ready
	PATH="$(CURDIR)/$(ZIG)/bin:$$PATH" tools/platforms/build.sh $(PLATFORMS)

# The Python package with the program and FMU binaries inside, dist/ftc_fmu-*.whl. PLATFORMS says for
# which systems its exports are; every one of them is built first.
wheel: build $(ZIG)/ready
	PATH="$(CURDIR)/$(ZIG)/bin:$$PATH" tools/platforms/build.sh $(PLATFORMS)
	PATH="$(CURDIR)/$(ZIG)/bin:$$PATH" tools/python/build.sh $(PLATFORMS)

# The wheel in an environment of its own that knows no Rust: its tests, the examples, and README's lines.
WHEEL := target/wheel

test-wheel:
	PYTHON="$(PYTHON)" tools/python/test.sh $(WHEEL)

# Closes an example's loop on every platform built, under wine and qemu, and compares the bits.
compare-platforms: fmu-all $(VENV)/ready
	PYTHONPATH=tests/support $(IN_VENV)python tests/platforms/compare.py examples/paper.toml

$(ZIG)/ready: tools/platforms/requirements.txt tools/python/requirements.txt
	rm -rf $(ZIG)
	$(PYTHON) -m venv $(ZIG)
	$(ZIG)/bin/pip install --quiet --disable-pip-version-check --requirement tools/platforms/requirements.txt --requirement tools/python/requirements.txt
	touch $@

test: lint package test-rust test-python

# In release mode: the design's optimisation problems are solved many times over, and the Python
# tests need the release binaries anyway.
test-rust: build
	cargo test --release --workspace --exclude ftc-python
	cargo test --release --package ftc-tables --no-default-features

# As many at a time as there are cores. PYTEST may hold options, such as --nothing-skipped.
test-python: build $(VENV)/ready
	$(IN_VENV)python -m pytest --numprocesses auto --dist worksteal $(PYTEST)

# Every kind of page the program writes, opened in a headless Chromium, which is installed where there
# is none. Pictures of what was seen are left in out/browser/seen.
BROWSER := out/browser

browser: build
	tests/browser/install.sh
	rm -rf $(BROWSER)
	target/release/ftc-fmu --quiet simulate examples/paper.toml --baselines --out $(BROWSER)/simulate
	target/release/ftc-fmu --quiet simulate examples/tank.toml --out $(BROWSER)/tank
	target/release/ftc-fmu --quiet reproduce paper --out $(BROWSER)/reproduce
	target/release/ftc-fmu --quiet reproduce converter --out $(BROWSER)/reproduce
	target/release/ftc-fmu --quiet campaign examples/paper.toml --runs 60 --out $(BROWSER)/campaign
	target/release/ftc-fmu --quiet export examples/paper.toml --out $(BROWSER)
	for fmu in controller plant; do $(PYTHON) -m zipfile -e $(BROWSER)/*_$$fmu.fmu $(BROWSER)/$$fmu; done
	$(PYTHON) tests/browser/check_pages.py --screenshots $(BROWSER)/seen $(BROWSER)/simulate/report.html \
		$(BROWSER)/campaign/campaign.html $(BROWSER)/tank/report.html $(BROWSER)/reproduce/paper.html $(BROWSER)/reproduce/converter.html \
		$(BROWSER)/controller/documentation/index.html $(BROWSER)/plant/documentation/index.html

# The demonstration needs FMPy alone, and of its dependencies what a loop of FMUs imports. Where no program is built
# yet, it compiles one without the formats of others, which it does not read, and with less optimisation of what it
# hardly runs (tools/demo.toml): its design of the example takes a hundredth of a second more. A later `make build`
# compiles these crates and the tools once more, and nothing else twice (by cargo 1.91 or later).
DEMO := target/demo
ifneq ($(wildcard target/release/ftc-fmu),)
DEMO_PROGRAM := target/release
demo: build
else
DEMO_PROGRAM := $(DEMO)/release
demo: $(DEMO)/program
endif

demo: $(DEMO)/python/ready
	FTC_FMU=$(DEMO_PROGRAM)/ftc-fmu PYTHONPATH=tests/support $(DEMO)/python/bin/python tests/fmpy/demo.py examples/paper.toml out/demo

.PHONY: $(DEMO)/program
$(DEMO)/program:
	CARGO_BUILD_BUILD_DIR=target cargo build --release --target-dir $(DEMO) --package ftc-fmu $(FMUS) --no-default-features --config tools/demo.toml
	tools/platforms/native.sh $(DEMO_PROGRAM)

$(DEMO)/python/ready: tests/requirements.txt
	rm -rf $(DEMO)/python
	$(PYTHON) -m venv $(DEMO)/python
	$(DEMO)/python/bin/pip install --quiet --disable-pip-version-check --no-compile --no-deps --constraint tests/requirements.txt FMPy attrs lxml numpy
	touch $@

bench: build $(VENV)/ready
	cargo bench --workspace
	PYTHONPATH=tests/support:tests/reference $(IN_VENV)python tests/reference/exact_proofs.py
	PYTHONPATH=tests/support $(IN_VENV)python tests/cvxpy/design_time.py --write docs/performance.md
	PYTHONPATH=tests/support:tests/fmpy $(IN_VENV)python tests/support/speed.py --write docs/performance.md

# Fuzzing needs a C++ compiler; each of TARGETS runs for SECONDS, ABREAST of them side by side.
SECONDS ?= 30
TARGETS ?= controller_calls plant_calls controller_design plant_design state location archive certificate
ABREAST ?= 1
FUZZ := env -u CARGO_ENCODED_RUSTFLAGS RUSTC_BOOTSTRAP=1 PATH="$(TOOLS)/bin:$$PATH" cargo fuzz
IN_FUZZ := --fuzz-dir fmu/fuzz --target-dir target/fuzz

fuzz: $(TOOLS)/$(FUZZER)
	$(FUZZ) build $(IN_FUZZ)
	printf '%s\n' $(TARGETS) | xargs -P $(ABREAST) -I TARGET sh -c '$(FUZZ) run $(IN_FUZZ) TARGET -- \
		-max_total_time=$(SECONDS) -rss_limit_mb=4096 -print_final_stats=1'

$(TOOLS)/$(FUZZER):
	cargo install --quiet --locked --debug --root $(TOOLS) $(FUZZER)
	touch $@

TICKS ?= 100000000

# Built with the whole workspace's features, so that what the tests compiled is used again.
soak:
	cargo build --release --workspace --exclude ftc-python --example soak
	target/release/examples/soak $(TICKS)

# valgrind over the C programs of tests/c on both FMUs: its memcheck on one instance and its twin,
# its two checkers of threads on eight threads with two loops each.
memcheck: build $(VENV)/ready
	PYTHONPATH=tests/support $(IN_VENV)python tests/support/c_host.py examples/paper.toml

lint: $(VENV)/ready
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	cargo clippy --package ftc-fmu --no-default-features -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps
	$(IN_VENV)ruff check
	$(IN_VENV)ruff format --check
	$(PYTHON) tests/promises.py
	$(PYTHON) tests/named.py

# Each library crate as it would be published, built from its archive alone.
LIBRARIES := ftc-plant ftc-control ftc-record ftc-lapack ftc-design ftc-simulate ftc-baselines ftc-identify

# Cargo takes a version it has unpacked once for unchanged for ever, also from the registry that
# it makes of these archives: what it unpacked of an earlier state goes first.
package:
	rm -rf target/packaged
	rm -rf $(LIBRARIES:%="$${CARGO_HOME:-$$HOME/.cargo}"/registry/src/-*/%-[0-9]*)
	CARGO_PROFILE_DEV_DEBUG=0 CARGO_PROFILE_DEV_OPT_LEVEL=0 cargo package --quiet --allow-dirty --target-dir target/packaged $(LIBRARIES:%=--package %)

clean:
	cargo clean
	rm -rf out $(VENV)

# Made anew whenever the requirements change, so that nothing is left of the old ones. Python compiles
# what is used of them when it is used.
$(VENV)/ready: tests/requirements.txt
	rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV)
	$(IN_VENV)pip install --quiet --disable-pip-version-check --no-compile --requirement tests/requirements.txt
	touch $@
