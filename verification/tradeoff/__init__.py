"""Speed against accuracy: what each setting gains, over scenes with closed forms or with limits of ever finer runs."""
