#!/usr/bin/perl
# Runs TAP tests and ends with one line that counts them. usage: run.pl [-j N] FILE...
use strict;
use warnings;
use TAP::Harness;

my $jobs = 1;
if (@ARGV > 1 && $ARGV[0] eq '-j') {
	(undef, $jobs) = splice @ARGV, 0, 2;
}
$ENV{CMOCKA_MESSAGE_OUTPUT} = 'TAP';
$| = 1;

my $harness = TAP::Harness->new({
	jobs => $jobs,
	timer => 1,
	exec => sub {
		my ($h, $file) = @_;
		return [$ENV{PYTHON} || '/usr/bin/python3', $file] if $file =~ /\.py$/;
		return ['sh', $file] if $file =~ /\.t$/;
		return [$file];
	},
});
my $all = $harness->runtests(@ARGV);
my $broken = grep { $_->has_problems && !$_->failed } map { $all->{parser_for}{$_} } @ARGV;
my $failed = scalar($all->failed) + $broken;
my ($passed, $skipped) = (scalar $all->passed, scalar $all->skipped);
printf "%d passed, %d failed, %d skipped\n", $passed - $skipped, $failed, $skipped;
exit($failed || !$all->all_passed ? 1 : 0);
