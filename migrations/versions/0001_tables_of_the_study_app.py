"""Tables of the study app."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Apply."""

    op.create_table(
        "secret",
        sa.Column("name", sa.String(length=40), nullable=False),
        sa.Column("value", sa.String(length=200), nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_secret")),
    )
    op.create_table(
        "study_version",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("study_id", sa.String(length=64), nullable=False),
        sa.Column("version", sa.String(length=64), nullable=False),
        sa.Column("state", sa.String(length=10), nullable=False),
        sa.Column("open_mode", sa.String(length=10), nullable=False),
        sa.Column("config", sa.JSON(), nullable=False),
        sa.Column("lists", sa.JSON(), nullable=False),
        sa.Column("catalogue_folder", sa.String(length=1000), nullable=False),
        sa.Column("catalogue_sha256", sa.String(length=64), nullable=False),
        sa.Column("group_key", sa.String(length=64), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("opened_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("closed_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("enrolled", sa.Integer(), nullable=False),
        sa.Column("withdrawn", sa.Integer(), nullable=False),
        sa.CheckConstraint(
            "state IN ('draft', 'open', 'closed')", name=op.f("ck_study_version_state")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_study_version")),
        sa.UniqueConstraint("study_id", "version", name=op.f("uq_study_version_study_id_version")),
    )
    with op.batch_alter_table("study_version", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_study_version_study_id"), ["study_id"], unique=False)

    op.create_table(
        "audit_entry",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("version_id", sa.Integer(), nullable=False),
        sa.Column("at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("action", sa.String(length=40), nullable=False),
        sa.Column("detail", sa.JSON(), nullable=False),
        sa.ForeignKeyConstraint(
            ["version_id"],
            ["study_version.id"],
            name=op.f("fk_audit_entry_version_id_study_version"),
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_audit_entry")),
    )
    with op.batch_alter_table("audit_entry", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_audit_entry_version_id"), ["version_id"], unique=False)

    op.create_table(
        "cell",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("version_id", sa.Integer(), nullable=False),
        sa.Column("scene", sa.String(length=64), nullable=False),
        sa.Column("target", sa.String(length=64), nullable=False),
        sa.Column("baseline", sa.String(length=64), nullable=False),
        sa.ForeignKeyConstraint(
            ["version_id"], ["study_version.id"], name=op.f("fk_cell_version_id_study_version")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_cell")),
        sa.UniqueConstraint(
            "version_id",
            "scene",
            "target",
            "baseline",
            name=op.f("uq_cell_version_id_scene_target_baseline"),
        ),
    )
    op.create_table(
        "clip",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("version_id", sa.Integer(), nullable=False),
        sa.Column("clip_id", sa.String(length=128), nullable=False),
        sa.Column("method", sa.String(length=64), nullable=False),
        sa.Column("file", sa.String(length=500), nullable=False),
        sa.Column("poster", sa.String(length=500), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("duration_s", sa.Double(), nullable=False),
        sa.Column("width", sa.Integer(), nullable=False),
        sa.Column("height", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(
            ["version_id"], ["study_version.id"], name=op.f("fk_clip_version_id_study_version")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_clip")),
        sa.UniqueConstraint("version_id", "clip_id", name=op.f("uq_clip_version_id_clip_id")),
    )
    op.create_table(
        "ticket",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("version_id", sa.Integer(), nullable=False),
        sa.Column("token_hash", sa.String(length=64), nullable=False),
        sa.Column("mode", sa.String(length=10), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint("mode IN ('simulated', 'preview')", name=op.f("ck_ticket_mode")),
        sa.ForeignKeyConstraint(
            ["version_id"], ["study_version.id"], name=op.f("fk_ticket_version_id_study_version")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_ticket")),
        sa.UniqueConstraint("token_hash", name=op.f("uq_ticket_token_hash")),
    )
    op.create_table(
        "pair",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("version_id", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(length=10), nullable=False),
        sa.Column("cell_id", sa.Integer(), nullable=True),
        sa.Column("label", sa.String(length=40), nullable=False),
        sa.Column("scene", sa.String(length=64), nullable=False),
        sa.Column("motion", sa.String(length=128), nullable=False),
        sa.Column("target_clip_id", sa.Integer(), nullable=False),
        sa.Column("baseline_clip_id", sa.Integer(), nullable=False),
        sa.Column("expected_method", sa.String(length=64), nullable=True),
        sa.CheckConstraint(
            "kind IN ('main', 'catch', 'identical', 'practice')", name=op.f("ck_pair_kind")
        ),
        sa.ForeignKeyConstraint(
            ["baseline_clip_id"], ["clip.id"], name=op.f("fk_pair_baseline_clip_id_clip")
        ),
        sa.ForeignKeyConstraint(["cell_id"], ["cell.id"], name=op.f("fk_pair_cell_id_cell")),
        sa.ForeignKeyConstraint(
            ["target_clip_id"], ["clip.id"], name=op.f("fk_pair_target_clip_id_clip")
        ),
        sa.ForeignKeyConstraint(
            ["version_id"], ["study_version.id"], name=op.f("fk_pair_version_id_study_version")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_pair")),
        sa.UniqueConstraint(
            "version_id",
            "kind",
            "target_clip_id",
            "baseline_clip_id",
            name=op.f("uq_pair_version_id_kind_target_clip_id_baseline_clip_id"),
        ),
    )
    with op.batch_alter_table("pair", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_pair_cell_id"), ["cell_id"], unique=False)

    op.create_table(
        "participant",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("version_id", sa.Integer(), nullable=False),
        sa.Column("code", sa.String(length=20), nullable=False),
        sa.Column("serial", sa.Integer(), nullable=False),
        sa.Column("mode", sa.String(length=10), nullable=False),
        sa.Column("state", sa.String(length=10), nullable=False),
        sa.Column("token_hash", sa.String(length=64), nullable=False),
        sa.Column("ticket_id", sa.Integer(), nullable=True),
        sa.Column("platform_hash", sa.String(length=64), nullable=True),
        sa.Column("enrolled_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("consent_sha256", sa.String(length=64), nullable=False),
        sa.Column("steps", sa.JSON(), nullable=False),
        sa.Column("seen_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("finished_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("completion_code", sa.String(length=64), nullable=True),
        sa.Column("browser", sa.String(length=40), nullable=False),
        sa.Column("excluded", sa.Boolean(), nullable=False),
        sa.CheckConstraint(
            "mode IN ('live', 'pilot', 'preview', 'simulated')", name=op.f("ck_participant_mode")
        ),
        sa.CheckConstraint("state IN ('enrolled', 'finished')", name=op.f("ck_participant_state")),
        sa.ForeignKeyConstraint(
            ["ticket_id"], ["ticket.id"], name=op.f("fk_participant_ticket_id_ticket")
        ),
        sa.ForeignKeyConstraint(
            ["version_id"],
            ["study_version.id"],
            name=op.f("fk_participant_version_id_study_version"),
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_participant")),
        sa.UniqueConstraint("token_hash", name=op.f("uq_participant_token_hash")),
        sa.UniqueConstraint("version_id", "code", name=op.f("uq_participant_version_id_code")),
        sa.UniqueConstraint(
            "version_id",
            "mode",
            "platform_hash",
            name=op.f("uq_participant_version_id_mode_platform_hash"),
        ),
    )
    with op.batch_alter_table("participant", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_participant_version_id"), ["version_id"], unique=False)

    op.create_table(
        "pair_count",
        sa.Column("pair_id", sa.Integer(), nullable=False),
        sa.Column("mode", sa.String(length=10), nullable=False),
        sa.Column("target_first", sa.Integer(), nullable=False),
        sa.Column("target_second", sa.Integer(), nullable=False),
        sa.CheckConstraint(
            "mode IN ('live', 'pilot', 'preview', 'simulated')", name=op.f("ck_pair_count_mode")
        ),
        sa.CheckConstraint(
            "target_first >= 0 AND target_second >= 0", name=op.f("ck_pair_count_not_negative")
        ),
        sa.ForeignKeyConstraint(["pair_id"], ["pair.id"], name=op.f("fk_pair_count_pair_id_pair")),
        sa.PrimaryKeyConstraint("pair_id", "mode", name=op.f("pk_pair_count")),
    )
    op.create_table(
        "trial",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("participant_id", sa.Integer(), nullable=False),
        sa.Column("ordinal", sa.Integer(), nullable=False),
        sa.Column("block", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(length=10), nullable=False),
        sa.Column("cell_id", sa.Integer(), nullable=True),
        sa.Column("repeat_of", sa.Integer(), nullable=True),
        sa.Column("state", sa.String(length=10), nullable=False),
        sa.Column("pair_id", sa.Integer(), nullable=True),
        sa.Column("target_first", sa.Boolean(), nullable=True),
        sa.Column("exposure_key", sa.String(length=200), nullable=True),
        sa.Column("counted", sa.Boolean(), nullable=False),
        sa.Column("token", sa.String(length=64), nullable=True),
        sa.Column("first_token", sa.String(length=64), nullable=True),
        sa.Column("second_token", sa.String(length=64), nullable=True),
        sa.Column("lease_expires_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("shown_at", sa.DateTime(timezone=True), nullable=True),
        sa.CheckConstraint(
            "kind IN ('main', 'catch', 'identical', 'repeat', 'practice')",
            name=op.f("ck_trial_kind"),
        ),
        sa.CheckConstraint(
            "state IN ('planned', 'leased', 'shown', 'answered', 'expired', 'void')",
            name=op.f("ck_trial_state"),
        ),
        sa.ForeignKeyConstraint(["cell_id"], ["cell.id"], name=op.f("fk_trial_cell_id_cell")),
        sa.ForeignKeyConstraint(["pair_id"], ["pair.id"], name=op.f("fk_trial_pair_id_pair")),
        sa.ForeignKeyConstraint(
            ["participant_id"], ["participant.id"], name=op.f("fk_trial_participant_id_participant")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_trial")),
        sa.UniqueConstraint("first_token", name=op.f("uq_trial_first_token")),
        sa.UniqueConstraint(
            "participant_id", "exposure_key", name=op.f("uq_trial_participant_id_exposure_key")
        ),
        sa.UniqueConstraint(
            "participant_id", "ordinal", name=op.f("uq_trial_participant_id_ordinal")
        ),
        sa.UniqueConstraint("second_token", name=op.f("uq_trial_second_token")),
        sa.UniqueConstraint("token", name=op.f("uq_trial_token")),
    )
    with op.batch_alter_table("trial", schema=None) as batch_op:
        batch_op.create_index(
            batch_op.f("ix_trial_lease_expires_at"), ["lease_expires_at"], unique=False
        )
        batch_op.create_index(batch_op.f("ix_trial_pair_id"), ["pair_id"], unique=False)
        batch_op.create_index(
            batch_op.f("ix_trial_participant_id"), ["participant_id"], unique=False
        )

    op.create_table(
        "response",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("trial_id", sa.Integer(), nullable=False),
        sa.Column("answer_uuid", sa.String(length=36), nullable=False),
        sa.Column("chosen_position", sa.String(length=6), nullable=False),
        sa.Column("response_time_ms", sa.Integer(), nullable=True),
        sa.Column("decision_time_ms", sa.Integer(), nullable=True),
        sa.Column("plays_first", sa.Integer(), nullable=True),
        sa.Column("plays_second", sa.Integer(), nullable=True),
        sa.Column("viewed_first", sa.String(length=10), nullable=False),
        sa.Column("viewed_second", sa.String(length=10), nullable=False),
        sa.Column("layout", sa.String(length=12), nullable=True),
        sa.Column("screen", sa.JSON(), nullable=False),
        sa.Column("answered_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("late", sa.Boolean(), nullable=False),
        sa.CheckConstraint(
            "chosen_position IN ('first', 'second')", name=op.f("ck_response_chosen_position")
        ),
        sa.CheckConstraint(
            "viewed_first IN ('proven', 'unproven', 'unknown')",
            name=op.f("ck_response_viewed_first"),
        ),
        sa.CheckConstraint(
            "viewed_second IN ('proven', 'unproven', 'unknown')",
            name=op.f("ck_response_viewed_second"),
        ),
        sa.ForeignKeyConstraint(
            ["trial_id"], ["trial.id"], name=op.f("fk_response_trial_id_trial")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_response")),
        sa.UniqueConstraint("trial_id", name=op.f("uq_response_trial_id")),
    )
    op.create_table(
        "viewing_event",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("trial_id", sa.Integer(), nullable=False),
        sa.Column("uuid", sa.String(length=36), nullable=False),
        sa.Column("kind", sa.String(length=20), nullable=False),
        sa.Column("position", sa.String(length=6), nullable=True),
        sa.Column("detail", sa.JSON(), nullable=False),
        sa.Column("received_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["trial_id"], ["trial.id"], name=op.f("fk_viewing_event_trial_id_trial")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_viewing_event")),
        sa.UniqueConstraint("trial_id", "uuid", name=op.f("uq_viewing_event_trial_id_uuid")),
    )
    with op.batch_alter_table("viewing_event", schema=None) as batch_op:
        batch_op.create_index(batch_op.f("ix_viewing_event_trial_id"), ["trial_id"], unique=False)


def downgrade() -> None:
    """Take back."""

    with op.batch_alter_table("viewing_event", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_viewing_event_trial_id"))

    op.drop_table("viewing_event")
    op.drop_table("response")
    with op.batch_alter_table("trial", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_trial_participant_id"))
        batch_op.drop_index(batch_op.f("ix_trial_pair_id"))
        batch_op.drop_index(batch_op.f("ix_trial_lease_expires_at"))

    op.drop_table("trial")
    op.drop_table("pair_count")
    with op.batch_alter_table("participant", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_participant_version_id"))

    op.drop_table("participant")
    with op.batch_alter_table("pair", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_pair_cell_id"))

    op.drop_table("pair")
    op.drop_table("ticket")
    op.drop_table("clip")
    op.drop_table("cell")
    with op.batch_alter_table("audit_entry", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_audit_entry_version_id"))

    op.drop_table("audit_entry")
    with op.batch_alter_table("study_version", schema=None) as batch_op:
        batch_op.drop_index(batch_op.f("ix_study_version_study_id"))

    op.drop_table("study_version")
    op.drop_table("secret")
