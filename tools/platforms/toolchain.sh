#!/usr/bin/env bash
# Unpacks Debian's Rust (packages rustc-web and friends) under target/platforms, for a target whose
# standard library the present toolchain lacks, and prints the path of its rustc. Installs nothing:
#
#     tools/platforms/toolchain.sh aarch64-unknown-linux-gnu
#
# With `packages NAME...` it unpacks just those, into $UNPACK_INTO.
#
# Runs on a Debian machine (amd64) as any user; does nothing that was done before.
set -euo pipefail
cd "$(dirname "$0")/../.."

target=$1
home=$PWD/target/platforms
root=${UNPACK_INTO:-$home/rust}
apt=(
    -qq -o Dir::State::lists="$home/apt/lists" -o Dir::Cache="$home/apt/cache"
    -o Dir::State::status="$home/apt/status" -o APT::Architectures::=amd64
    -o APT::Sandbox::User="$(id -un)"
)

# unpack PACKAGE...: fetches packages and unpacks them into the toolchain's root
unpack() {
    mkdir -p "$home/packages" "$home/apt/lists/partial" "$home/apt/cache/archives/partial" "$root"
    : >"$home/apt/status"
    for package in "$@"; do
        [[ $package != *:* ]] || apt+=(-o "APT::Architectures::=${package#*:}")
    done
    apt-get "${apt[@]}" update >&2
    for package in "$@"; do
        rm -f "$home/packages/"*
        (cd "$home/packages" && apt-get "${apt[@]}" download "$package" >&2)
        dpkg --extract "$home/packages/"*.deb "$root"
    done
    rm -rf "$home/packages"
}

if [ "$target" = packages ]; then
    shift
    unpack "$@"
    exit
fi

version() {
    apt-cache "${apt[@]}" depends libstd-rust-web-dev:amd64 | sed -n 's/.*Depends: \(libstd-rust-web-[0-9.]*\).*/\1/p' | head -1
}

if [ ! -x "$root/rustc" ]; then
    unpack rustc-web:amd64 libstd-rust-web-dev:amd64
    library=$(version)
    compiler=$(apt-cache "${apt[@]}" depends "$library:amd64" | sed -n 's/.*Depends: \(libllvm[0-9]*\).*/\1/p' | head -1)
    unpack "$library:amd64" "$compiler:amd64"
    cat >"$root/rustc" <<END
#!/bin/sh
LD_LIBRARY_PATH='$root/usr/lib/x86_64-linux-gnu' exec '$root/usr/bin/rustc' --sysroot '$root/usr' "\$@"
END
    chmod +x "$root/rustc"
fi

case $target in
aarch64-unknown-linux-gnu) [ -d "$root/usr/lib/rustlib/$target" ] || unpack libstd-rust-web-dev:arm64 ;;
*) [ -e "$root/usr/lib/rustlib/src/rust" ] || unpack rust-web-src ;;
esac
echo "$root/rustc"
