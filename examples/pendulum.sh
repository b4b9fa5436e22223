# Friction in the bearing of a free pendulum, whose makers took it for viscous:
# sh examples/pendulum.sh FOLDER, with the published set single_pendulum_bearing_friction.
set -eu
. "$(dirname "$0")/common.sh"
beside pendulum "${1-}"

# Two thirds of a large swing, then the rest of it and a small swing, which were not fitted.
step reconcile experiment.toml --out repaired.toml
step compare rest.toml --apply repaired.toml
step compare unseen.toml --apply repaired.toml
