#!/bin/sh
# Run a command with a Rust toolchain: the one of this machine, or one in .rust of this clone.
#
#     setup/with_rust.sh cargo build
#
# If neither is new enough, the script installs a toolchain into .rust.
set -u
root=$(cd "$(dirname "$0")/.." && pwd)
needed=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' "$root/Cargo.toml")
installer_url=https://sh.rustup.rs

# The version of cargo; empty if cargo does not run, as rustup's cargo without a toolchain.
cargo_version() {
  cargo --version 2>/dev/null | cut -d ' ' -f 2
}

is_new_enough() {
  [ -n "$1" ] && [ "$(printf '%s\n' "$needed" "$1" | sort -V | head -n 1)" = "$needed" ]
}

download() {
  curl --proto '=https' --tlsv1.2 --silent --show-error --fail "$1" || wget --quiet --output-document=- "$1"
}

version=$(cargo_version)
is_new_enough "$version" && exec "$@"

export RUSTUP_HOME="$root/.rust/rustup" CARGO_HOME="$root/.rust/cargo"
export PATH="$CARGO_HOME/bin:$PATH"
is_new_enough "$(cargo_version)" && exec "$@"

if [ -n "$version" ]; then
  problem="only cargo $version is on PATH"
elif command -v cargo >/dev/null; then
  problem="cargo does not run"
else
  problem="cargo is not on PATH"
fi
echo "overtaking needs Rust $needed or newer, and $problem: installing Rust into $root/.rust" >&2
mkdir -p "$root/.rust"
installer="$root/.rust/rustup-init.sh"
if download "$installer_url" > "$installer" && sh "$installer" -y --quiet --no-modify-path \
    --default-toolchain stable --profile minimal --component clippy --component rustfmt >&2 \
    && is_new_enough "$(cargo_version)"; then
  exec "$@"
fi
echo "Rust could not be downloaded. Where the network allows it, install Rust with" >&2
echo "    curl --proto '=https' --tlsv1.2 -sSf $installer_url | sh" >&2
echo "and run make again." >&2
exit 1
