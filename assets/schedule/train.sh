#!/bin/sh
# Trains the clips of a ClipGStream project. Run `sh train.sh` on every computer that sees these folders: together they
# train each clip once. JOBS=2 sh train.sh trains two clips at once on a computer. Running it again resumes.

PYTHON=@python@
CAPTURE=@capture@
PROJECT=@project@
JOBS=${JOBS:-1}
[ "$JOBS" = 1 ] || export CLIPGSTREAM_CORES=$((($(getconf _NPROCESSORS_ONLN) + JOBS - 1) / JOBS))

if [ $# = 1 ]; then # one clip; prints its number if it has to be tried again later
    for try in 1 2 3; do # one that failed resumes from its checkpoint
        "$PYTHON" -P -m ui train "$CAPTURE" --project "$PROJECT" --clip "$1" >&2
        code=$?
        [ $code = 1 ] || break
    done
    case $code in
    75) echo "$1" ;; # being trained by another computer
    0 | 1 | 3) exit $code ;; # 3: stopped by a person
    *) exit 255 ;; # bad input, or interrupted: xargs stops
    esac
    exit
fi

train() {
    left=$*
    while [ -n "$left" ]; do
        left=$(printf '%s\n' $left | xargs -n 1 -P "$JOBS" sh "$0") || return
        [ -z "$left" ] || sleep 30
    done
}
train @reference@ && train @sequences@
