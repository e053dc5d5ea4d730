#!/usr/bin/env bash
# Builds the FMU binaries of the named platforms, one after the other:
#
#     tools/platforms/build.sh PLATFORM...
#
# into target/release/fmu-binaries/PLATFORM, where `ftc-fmu export` finds them.
# Those of Linux need cargo-zigbuild (requirements.txt) on the path, win64 mingw-w64.
# A Rust toolchain that has the platform's standard library is used as it is; else Debian's is
# unpacked under target/platforms (see toolchain.sh), and the standard library of win64 is built.
set -euo pipefail
cd "$(dirname "$0")/../.."

packages=(--package ftc-controller-fmu --package ftc-plant-fmu --lib --release)

has_library_for() {
    [ -d "$("${RUSTC:-rustc}" --print target-libdir --target "$1")" ]
}

# build TARGET SUFFIX COMMAND...: by which cargo command, for which glibc
build() {
    local target=$1 glibc=$2
    shift 2
    if has_library_for "$target"; then
        CARGO_ENCODED_RUSTFLAGS=$(tools/platforms/remap.sh "${linking[@]}") "$@" "${packages[@]}" --target "$target$glibc"
        built=target/$target/release
        return
    fi
    RUSTC=$(tools/platforms/toolchain.sh "$target")
    export RUSTC
    local standard=()
    if ! has_library_for "$target"; then
        export RUSTC_BOOTSTRAP=1
        standard=(-Zbuild-std=std,panic_unwind)
    fi
    CARGO_ENCODED_RUSTFLAGS=$(tools/platforms/remap.sh "${linking[@]}") \
        "$@" "${packages[@]}" --target "$target$glibc" --target-dir target/platforms/build "${standard[@]}"
    unset RUSTC RUSTC_BOOTSTRAP
    built=target/platforms/build/$target/release
}

# pack PLATFORM PREFIX EXTENSION: copies what was built to where the exporter looks
pack() {
    local folder=target/release/fmu-binaries/$1
    mkdir -p "$folder"
    for name in ftc_controller ftc_plant; do
        cp "$built/$2${name}_fmu.$3" "$folder/$name.$3"
    done
    echo "built $folder"
}

for platform in "$@"; do
    # Flags of rustc for this platform alone.
    linking=()
    case $platform in
    linux64)
        build x86_64-unknown-linux-gnu .2.17 cargo zigbuild
        pack linux64 lib so
        ;;
    aarch64-linux)
        build aarch64-unknown-linux-gnu .2.17 cargo zigbuild
        pack aarch64-linux lib so
        ;;
    win64)
        # Everything but the system's own DLLs goes into the library.
        export CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER=x86_64-w64-mingw32-gcc
        linking=(-Ctarget-feature=+crt-static)
        build x86_64-pc-windows-gnu "" cargo build
        pack win64 "" dll
        ;;
    *)
        echo "no platform '$platform': use linux64, win64 or aarch64-linux" >&2
        exit 2
        ;;
    esac
done
