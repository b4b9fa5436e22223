# Two heaters and sensors on one board, of which one is driven: the coupling between them and the lag
# of a sensor: sh examples/heater.sh FOLDER, with the published set tclab_heater_coupling_lag.
set -eu
. "$(dirname "$0")/common.sh"
beside heater "${1-}"

# A step of the heater, then a sine, which was not fitted.
step reconcile experiment.toml --out repaired.toml
step compare unseen.toml --apply repaired.toml
