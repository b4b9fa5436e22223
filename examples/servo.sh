# Backlash of hobby servos that hold a target while two others pull them left and right:
# sh examples/servo.sh FOLDER, with the published set servo_backlash_sts3215.
set -eu
. "$(dirname "$0")/common.sh"
beside servo "${1-}"

# The first half of a run of one servo, then its second half, which was not fitted.
step reconcile experiment.toml --out repaired.toml
step compare unseen.toml --apply repaired.toml
# A pair of servos, and the same with a preload that takes the play away: the difference is backlash.
step reconcile pair.toml
# Negative control: the preloaded pair alone.
step reconcile preloaded.toml
