"""How wrong a result may be: passes, estimates of error, pre-runs, the choice of model and fineness."""
