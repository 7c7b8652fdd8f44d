rule events:
    """Seismic events of one step: rock that fails together, touches and has like mechanisms."""
    input:
        STAGES.inputs_of("seismic events", "events/{step}", step=FILES.state),
    output:
        kept(f"{RESULTS}/events/{{step}}.nc"),
    log:
        "logs/{mine}/events/{step}.log",
    conda:
        "../envs/environment.yaml"
    threads: OPTIONS.reading_threads
    resources:
        in_idle_time=OPTIONS.in_idle_time,
        mem_mb=OPTIONS.reading_memory("events"),
        runtime=60,
    params:
        code=source_hash("seismic events"),
        settings=STAGES.event_slice,
    shell:
        "CORES_OF_STAGE={threads} NUMBA_NUM_THREADS=1 stage seismic events --step {input.step} --settings {params.settings:q} --output {output} --log {log}"


rule catalog:
    """The synthetic catalogue of all dated steps."""
    input:
        STAGES.inputs_of("seismic catalog", "catalog", events=FILES.events),
    output:
        catalog=kept(f"{RESULTS}/catalog.nc"),
        table=OPTIONS.packed(f"{RESULTS}/catalog.csv", "catalogue"),
    log:
        "logs/{mine}/catalog.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        code=source_hash("seismic catalog"),
        settings=STAGES.slice_of("catalog"),
    shell:
        "stage seismic catalog --events {input.events} --settings {params.settings:q} --output {output.catalog} --csv {output.table} --log {log}"


rule closeness:
    """Sizes of the events of all dated steps at several values of closeness, and with shorter links, for the report."""
    input:
        STAGES.inputs_of("seismic closeness", "closeness", steps=FILES.dated_steps),
    output:
        kept(f"{RESULTS}/closeness.nc"),
    log:
        "logs/{mine}/closeness.log",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=OPTIONS.reading_memory("events"),
        runtime=60,
    params:
        code=source_hash("seismic closeness"),
        settings=STAGES.slice_of("closeness"),
    shell:
        "NUMBA_NUM_THREADS={threads} stage seismic closeness --steps {input.steps} --settings {params.settings:q} --output {output} --log {log}"


rule vtk_events:
    """Events for ParaView, on request: vtk/catalog.vtu, vtk/record.vtu or vtk/events/<step>.vtu."""
    input:
        catalog=f"{RESULTS}/{{catalog}}.nc",
    output:
        f"{RESULTS}/vtk/{{catalog}}.vtu",
    log:
        "logs/{mine}/vtk/{catalog}.log",
    wildcard_constraints:
        catalog="catalog|record|events/.+",
    conda:
        "../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=each_time(1000),
        runtime=10,
    params:
        code=source_hash("catalogs vtk"),
    shell:
        "stage catalogs vtk --catalog {input.catalog} --output {output} --log {log}"
