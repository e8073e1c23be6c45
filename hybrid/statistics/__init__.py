"""What histories amount to: moments, crossings, spectra, extremes, fatigue.  Arrays in, numbers out."""
