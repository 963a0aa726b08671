"""Control methods: what each of them brings, a package each."""
