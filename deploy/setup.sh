# For deploy/quickstart, deploy/test and .ci/run, which source it: installs what is missing from Debian's packages,
# configures and builds. Everything that is done already is skipped.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '\033[1m== %s\033[0m\n' "$*"; }

# install_packages FILE...: installs the packages listed in the files that are not there yet.
install_packages() {
  local package missing=() as_root=()
  for package in $(sed 's/#.*//' "$@"); do
    dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
  done
  if [ ${#missing[@]} -eq 0 ]; then return; fi
  say "installing ${missing[*]}"
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo > /dev/null || {
      echo "These packages are missing and need root to be installed: ${missing[*]}" >&2
      echo "Run as root: apt-get install ${missing[*]}" >&2
      exit 1
    }
    as_root=(sudo)
  fi
  "${as_root[@]}" apt-get update
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}"
}

# build [TARGET...]: configures build/ once (Release, Ninja; ccache is used where it is present) and builds.
build() {
  if [ ! -f build/build.ninja ]; then
    say "configuring build/"
    cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release
  fi
  say "building"
  cmake --build build --parallel "$(nproc)" ${1:+--target "$@"}
}
