"""Alembic's entry: migrations run over the connection that `study_app.db` hands in, or over a URL."""

from alembic import context

from study_app.models import Base


def run_migrations() -> None:
    """Run all pending migrations in one transaction (batch mode: SQLite cannot alter columns)."""
    connection = context.config.attributes.get("connection")
    if connection is None:
        from study_app.db import Database
        from study_app.settings import read_settings

        engine = Database(read_settings().database_url).engine
        connection = engine.execution_options(pace_write=True).connect()
    context.configure(
        connection=connection,
        target_metadata=Base.metadata,
        render_as_batch=True,
        compare_type=True,
        user_module_prefix="study_app.models.",
    )
    with context.begin_transaction():
        context.run_migrations()


run_migrations()
