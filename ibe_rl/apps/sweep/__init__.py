"""Many runs of train.py: started side by side, taken up again, and told about in one report."""
