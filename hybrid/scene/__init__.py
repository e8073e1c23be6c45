"""What there is: a scene as tables of a YAML file, checked where it is written."""
