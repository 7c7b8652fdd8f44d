"""From plastic strain to the synthetic catalogue, beside the recorded one."""

if FILES.has_record:

    rule record:
        """The recorded catalogue, read and filtered.

        Before the grid and what is solved on it: one that cannot be read ends the run at once.
        """
        input:
            **INPUTS.of("record"),
        output:
            FILES.own("record.nc"),
        log:
            f"{OWN_LOGS}/record.log",
        priority: 2
        localrule: True
        conda:
            ENVIRONMENT
        threads: RESOURCES.all_cores  # nothing begins beside it
        resources:
            mem_mb=2000,
            runtime=30,
        shell:
            RUN


rule events:
    """Seismic events of all steps: rock that fails together, touches and has like mechanisms; and their catalogue."""
    input:
        **INPUTS.of("events", steps=FILES.states, grid=FILES.grid),
    output:
        directory(f"{RESULTS}/events"),
        f"{RESULTS}/catalog.nc",
    log:
        f"{LOGS}/events.log",
    conda:
        ENVIRONMENT
    threads: 4
    resources:
        mem_mb=RESOURCES.reading_memory("events", at_once=4),  # a state in each process
        runtime=60,
    shell:
        RUN


rule catalogue:
    """The synthetic catalogue as a table and as QuakeML 1.2, and sizes of events at other values of closeness."""
    input:
        **INPUTS.of("catalogue", catalog=f"{RESULTS}/catalog.nc", steps=FILES.dated_states),
    output:
        table=report(
            f"{RESULTS}/catalog.csv",
            caption="../report/catalogue.rst",
            category="{mine}",
            labels={"result": "catalogue"},
        ),
        event_rules=f"{RESULTS}/event_rules.nc",
        source_parameters=f"{RESULTS}/source_parameters.nc",
        quakeml=[f"{RESULTS}/catalog.xml"] if FILES.has_quakeml else [],
    log:
        f"{LOGS}/catalogue.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.reading_memory("events"),
        runtime=60,
    shell:
        RUN


rule twin:
    """A record for a mine that has none: this mine's catalogue with location noise and a completeness cut, as CSV."""
    input:
        **INPUTS.of("twin", catalog=FILES.own("catalog.nc")),
    output:
        FILES.own("twin.csv"),
    log:
        f"{OWN_LOGS}/twin.log",
    localrule: True
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    shell:
        RUN
