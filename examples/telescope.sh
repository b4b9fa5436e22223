# Periodic error of a telescope mount, once per turn of its worm, seen by a guide camera in a closed
# loop: sh examples/telescope.sh FOLDER, with the published set telescope_worm_periodic_error.
set -eu
. "$(dirname "$0")/common.sh"
beside telescope "${1-}"

# 60 % of a run, then the rest of it, which was not fitted.
step reconcile experiment.toml --out repaired.toml
step compare unseen.toml --apply repaired.toml
# Negative controls: the axis that has no moving worm, and the worm of another mount.
step reconcile declination.toml
step reconcile wrong.toml --only "worm of 479 s"
