# What the scripts of the measured machines share; each names itself and the folder of its data.

# beside NAME FOLDER: go to a new folder that holds the files of examples/NAME and the CSV files of
# FOLDER. It is removed at the end.
beside() {
    files=$(cd "$(dirname "$0")/$1" && pwd)
    if [ -z "${2-}" ] || ! ls "$2"/*.csv >/dev/null 2>&1; then
        echo "usage: sh examples/$1.sh FOLDER, which holds the CSV files of the published set" >&2
        exit 2
    fi
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    cp "$files"/*.toml "$2"/*.csv "$work"
    cd "$work"
}

# step WORDS ...: print the command `mopro WORDS ...`, and run it. Findings (exit 1) are no failure.
step() {
    printf '\n$ mopro %s\n' "$*"
    mopro "$@" || [ $? -eq 1 ]
}
