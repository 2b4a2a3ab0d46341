# Shared by deploy/quickstart, deploy/test and .ci/run: source it, then call its functions from the root of the tree.
# Stops the caller on the first failure.
set -euo pipefail

say() { printf '\n== %s\n' "$*"; }

# install_missing FILE...: installs the packages named in the files that are not there yet.
install_missing() {
  local package missing=()
  while read -r package; do
    if [[ "$(dpkg-query -W -f='${Status}' "$package" 2>/dev/null)" != "install ok installed" ]]; then
      missing+=("$package")
    fi
  done < <(grep -hvE '^(#|$)' "$@")
  [[ ${#missing[@]} -eq 0 ]] && return
  local as_root=()
  if [[ "$(id -u)" -ne 0 ]]; then
    command -v sudo >/dev/null || { echo "not root and no sudo: install ${missing[*]} yourself" >&2; exit 1; }
    as_root=(sudo)
  fi
  say "installing ${missing[*]}"
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
}

# build_release ON|OFF: configures and builds into build/, with or without the tests.
build_release() {
  say "building (Release)"
  cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DDBR_TESTS="$1" -DDBR_BENCH="$1" >build-configure.log ||
    { cat build-configure.log >&2; exit 1; }
  cmake --build build
}
