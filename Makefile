# make run    builds Tyndall, starts it and prints the address to open; ARGS='--scene cloud' passes through
# make test   every check and every test, the browser's included
#
# Both install what they miss on Debian and Ubuntu, and name it elsewhere.

SHELL := /bin/bash
ARGS ?=

# Software Vulkan compiles each kernel once, not in every process.
export MESA_SHADER_CACHE_DIR := $(CURDIR)/target/mesa

.PHONY: run test test-rust test-browser test-long bench image thumbs needs needs-browser

run: needs
	cargo build --release
	exec target/release/tyndall serve $(ARGS)

# NODEVICE_SELECT: Mesa asks for a desktop to choose between GPUs, and complains where there is none.
test: test-rust test-browser

test-rust: needs
	cargo fmt --check
	cargo clippy --all-targets -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --no-deps --document-private-items
	NODEVICE_SELECT=1 cargo test

test-browser: needs needs-browser
	cargo build
	cd tests/browser && npm ci --no-audit --no-fund && npm run check && npm test

# The same tests with more rounds where chance is involved, in release.
test-long: needs
	TYNDALL_TEST_ROUNDS=50 cargo test --release

bench: needs
	cargo bench

image:
	$(if $(shell command -v docker),docker build,podman build --format docker) -t tyndall .

# Small pictures of the presets, for the page.
thumbs: needs
	cargo build --release
	mkdir -p static/thumbs
	for name in $$(target/release/tyndall presets --names); do \
		target/release/tyndall render $$name --size 240x150 --spp 400 -o static/thumbs/$$name.jpg || exit 1; \
	done

# $(call install,PACKAGES): with apt where there is one; elsewhere a person must do it.
define install
	if [ -n "$(strip $(1))" ]; then \
		if ! command -v apt-get >/dev/null; then echo "Please install the equivalents of these Debian packages: $(1)" >&2; exit 1; fi; \
		sudo=; [ "$$(id -u)" = 0 ] || sudo=sudo; \
		echo "Installing $(1)"; \
		$$sudo apt-get update -qq && DEBIAN_FRONTEND=noninteractive $$sudo apt-get install -y -qq --no-install-recommends $(1) >/dev/null; \
	fi
endef

has = $(shell command -v $(1))
linux := $(filter Linux,$(shell uname -s))
loader := $(shell /sbin/ldconfig -p 2>/dev/null | grep -o -m1 'libvulkan\.so\.1')
driver := $(wildcard /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json)

needs:
	@$(call install,$(if $(call has,cc),,gcc libc6-dev) $(if $(linux),$(if $(loader),,libvulkan1) $(if $(driver),,mesa-vulkan-drivers)))
	@command -v cargo >/dev/null || { echo 'Please install Rust: https://rustup.rs' >&2; exit 1; }

browser := $(or $(call has,chromium),$(call has,chromium-browser),$(call has,google-chrome))

needs-browser:
	@$(call install,$(if $(call has,npm),,nodejs npm) $(if $(browser),,chromium))
