"""Results in files for other programs, on request: `snakemake export`."""

EXPORT_RESULTS, EXPORT_LOGS = FILES.own("export"), f"{OWN_LOGS}/export"
CATALOGUE_FILES = [
    f"{name}.{ending}"
    for name, is_there in (("events", FILES.has_catalog), ("recorded_events", FILES.has_record))
    if is_there
    for ending in ("dxf", "omf", "csv")
]


rule export_step:
    """Stress and failed rock of a step in the mine's own coordinates: VTU, closed surfaces in DXF and OMF, a table."""
    input:
        **INPUTS.of(
            "export_step",
            "{step}",
            grid=FILES.own("grid.nc"),
            state=FILES.own("steps/{step}.nc"),
        ),
    output:
        cells=f"{EXPORT_RESULTS}/steps/{{step}}/cells.vtu",
        rock=[f"{EXPORT_RESULTS}/steps/{{step}}/failed_rock.{ending}" for ending in ("dxf", "omf", "csv")],
    log:
        f"{EXPORT_LOGS}/{{step}}.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=RESOURCES.reading_memory("vtk"),
        runtime=30,
    shell:
        RUN


rule export:
    """Events as points in DXF and OMF and as tables, and a list of what the files of all steps hold."""
    input:
        **INPUTS.of(
            "export",
            catalog=FILES.own("catalog.nc") if FILES.has_catalog else [],
            record=FILES.if_recorded("record.nc"),
            source_parameters=FILES.own("source_parameters.nc") if FILES.has_catalog else [],
            steps=[f"{EXPORT_RESULTS}/steps/{step}/failed_rock.omf" for step in MINE.mined_steps],
        ),
    output:
        contents=f"{EXPORT_RESULTS}/contents.csv",
        catalogues=[f"{EXPORT_RESULTS}/{name}" for name in CATALOGUE_FILES],
    log:
        f"{EXPORT_LOGS}/catalogues.log",
    conda:
        ENVIRONMENT
    threads: 1
    resources:
        mem_mb=by_attempt(2000),
        runtime=30,
    shell:
        RUN
