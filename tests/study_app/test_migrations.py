"""The migrations build exactly what the models say, and can be taken back."""

from __future__ import annotations

import sqlalchemy
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext

from study_app.db import Database, alembic_config, upgrade
from study_app.models import Base


def test_the_migrations_and_the_models_agree(database: Database) -> None:
    with database.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, Base.metadata) == []


def test_downgrade_leaves_nothing_and_upgrade_brings_all_back(database: Database) -> None:
    with database.engine.execution_options(pace_write=True).connect() as connection:
        command.downgrade(alembic_config(connection), "base")
        connection.commit()
    assert sqlalchemy.inspect(database.engine).get_table_names() == ["alembic_version"]
    upgrade(database)
    tables = set(sqlalchemy.inspect(database.engine).get_table_names())
    assert tables == {*Base.metadata.tables, "alembic_version"}


def test_the_database_itself_refuses_a_second_answer_and_a_second_seat(database: Database) -> None:
    unique = {
        table: {
            tuple(key["column_names"])
            for key in sqlalchemy.inspect(database.engine).get_unique_constraints(table)
        }
        for table in ("trial", "response", "viewing_event")
    }
    assert ("trial_id",) in unique["response"]
    assert {("participant_id", "ordinal"), ("participant_id", "exposure_key")} <= unique["trial"]
    assert ("trial_id", "uuid") in unique["viewing_event"]
