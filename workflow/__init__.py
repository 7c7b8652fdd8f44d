"""The workflow: configuration, rules, profiles. Points to mpm_core, seismic and catalogs; none of them points back."""
