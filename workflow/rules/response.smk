"""What drives and stopes feel."""

if MINE.mined_steps:

    rule openings:
        """Depth of failure, closure and stress at the walls of each excavation, by step, side and chainage."""
        input:
            **INPUTS.of(
                "openings",
                grid=FILES.own("grid.nc"),
                steps=FILES.own_states(MINE.mined_steps),
                events=FILES.own("events"),
                record=FILES.if_recorded("record.nc"),
            ),
        output:
            table=report(
                FILES.own("openings.csv"),
                caption="../report/openings.rst",
                category=MINE.name,
                labels={"result": "openings"},
            ),
            dataset=FILES.own("openings.nc"),
        log:
            f"{OWN_LOGS}/openings.log",
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=RESOURCES.reading_memory("openings"),
            runtime=60,
        shell:
            RUN


if FILES.has_observations:

    rule observations:
        """What the model gives where instruments are, beside what they measured."""
        input:
            **INPUTS.of("observations", grid=FILES.own("grid.nc"), steps=FILES.own_states(MINE.mined_steps)),
        output:
            table=report(
                FILES.own("observations.csv"),
                caption="../report/observations.rst",
                category=MINE.name,
                labels={"result": "observations"},
            ),
            dataset=FILES.own("observations.nc"),
        log:
            f"{OWN_LOGS}/observations.log",
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=RESOURCES.observation_memory,
            runtime=60,
        shell:
            RUN


if FILES.has_scans:

    rule scans:
        """Overbreak of scanned voids by wall, beside the rock that has failed there."""
        input:
            **INPUTS.of("scans", grid=FILES.own("grid.nc"), steps=FILES.own_states(MINE.scan_steps)),
        output:
            table=report(
                FILES.own("scans.csv"),
                caption="../report/scans.rst",
                category=MINE.name,
                labels={"result": "scanned voids"},
            ),
            dataset=FILES.own("scans.nc"),
        log:
            f"{OWN_LOGS}/scans.log",
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=RESOURCES.reading_memory("scans"),
            runtime=60,
        shell:
            RUN


if FILES.has_loading:

    rule loading:
        """Energy that mining releases, plastic work, loading stiffness and excess shear stress."""
        input:
            **INPUTS.of(
                "loading",
                grid=FILES.own("grid.nc"),
                elastic=FILES.own("elastic.nc"),
                steps=FILES.own_states(MINE.mined_steps),
            ),
        output:
            table=report(
                FILES.own("loading.csv"),
                caption="../report/loading.rst",
                category=MINE.name,
                labels={"result": "loading measures"},
            ),
            dataset=FILES.own("loading.nc"),
        log:
            f"{OWN_LOGS}/loading.log",
        conda:
            ENVIRONMENT
        threads: 1
        resources:
            mem_mb=RESOURCES.reading_memory("loading"),
            runtime=60,
        shell:
            RUN
