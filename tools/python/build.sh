#!/usr/bin/env bash
# Builds the wheel into dist/: the Python package, the command line, and FMU binaries of the named
# platforms, which must have been built into target/release/fmu-binaries:
#
#     tools/python/build.sh PLATFORM...
#
# For another machine than this one: TARGET=aarch64-unknown-linux-gnu, by Debian's Rust where the present one
# lacks its standard library (tools/platforms/toolchain.sh). Needs maturin and ziglang (requirements.txt) on the
# path.
set -euo pipefail
cd "$(dirname "$0")/../.."

package=tools/python/ftc_fmu
rm -rf "$package/fmu-binaries"
for platform in "$@"; do
    mkdir -p "$package/fmu-binaries/$platform"
    cp target/release/fmu-binaries/"$platform"/* "$package/fmu-binaries/$platform/"
done
if [ -n "${TARGET:-}" ] && [ ! -d "$(rustc --print target-libdir --target "$TARGET")" ]; then
    RUSTC=$(tools/platforms/toolchain.sh "$TARGET")
    export RUSTC CARGO_TARGET_DIR=target/platforms/build
fi
CARGO_ENCODED_RUSTFLAGS=$(tools/platforms/remap.sh) maturin build --release --zig --compatibility manylinux2014 --manifest-path tools/python/Cargo.toml \
    ${TARGET:+--target "$TARGET"} --out dist
echo "the wheel holds FMU binaries for: $*"
