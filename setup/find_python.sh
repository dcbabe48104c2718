#!/bin/sh
# Print the path of a Python that this project can use.
#
#     setup/find_python.sh NAME     the command NAME, or another Python if NAME cannot be used
#     setup/find_python.sh 3.13     a Python 3.13, and no other
#
# pyproject.toml states the lowest supported version, and the versions that are tested.
set -u
project="$(dirname "$0")/../pyproject.toml"
lowest=$(sed -n 's/^requires-python = ">=3\.\([0-9]*\)"/\1/p' "$project")
tested=$(sed -n 's/.*Programming Language :: Python :: 3\.\([0-9]*\)".*/\1/p' "$project" | sort -rn)

# Version and path of the Python that a command runs; empty if the command fails. pyenv puts a shim
# on PATH for every version, and the shims of inactive versions fail.
describe() {
  "$1" -c 'import sys; print("%d %d %s" % (sys.version_info[0], sys.version_info[1], sys.executable))' \
    </dev/null 2>/dev/null
}

# Debian's Python cannot make environments without the package python3-venv.
can_make_environments() {
  "$1" -c 'import ensurepip, venv' </dev/null 2>/dev/null
}

# The commands that may be a Python 3.$1.
commands_for() {
  echo "python3.$1"
  for folder in "${PYENV_ROOT:-$HOME/.pyenv}/versions" "$HOME/.local/share/uv/python"; do
    for command in "$folder"/*/bin/"python3.$1"; do
      if [ -x "$command" ]; then echo "$command"; fi
    done
  done
}

# Print the first command on standard input that is a usable Python, from version 3.$1 to 3.$2.
first_usable() {
  while read -r command; do
    describe "$command" | {
      read -r major minor file && [ "$major" = 3 ] && [ "$minor" -ge "$1" ] &&
        [ "$minor" -le "$2" ] && can_make_environments "$file" && echo "$file"
    } && return 0
  done
  return 1
}

case "$1" in
  3.[0-9]*)
    commands_for "${1#3.}" | first_usable "${1#3.}" "${1#3.}" && exit 0
    echo "Python $1 is not installed: no python$1 on PATH, in pyenv or in uv runs and makes environments" >&2
    exit 1 ;;
esac

echo "$1" | first_usable "$lowest" 99 && exit 0
case "$1" in
  python3.*) commands_for "${1#python3.}" | first_usable "$lowest" 99 && exit 0 ;;
esac
version=$(describe "$1" | cut -d ' ' -f 1,2 | tr ' ' .)
if [ -z "$version" ]; then
  problem="$1 does not run"
elif [ "${version#3.}" = "$version" ] || [ "${version#3.}" -lt "$lowest" ]; then
  problem="$1 is Python $version, overtaking needs 3.$lowest or newer"
else
  problem="$1 cannot make environments (Debian: install python3-venv)"
fi
for minor in $tested; do
  if python=$(commands_for "$minor" | first_usable "$minor" "$minor"); then
    echo "$problem: using $python" >&2
    echo "$python"
    exit 0
  fi
done
echo "$problem, and no other Python was found: install one, then run make PYTHON=/path/to/python3" >&2
exit 1
